#pragma once

// The figures of an organ on stdout, for people and for programs.

#include <string>

#include "server/organs/organ/organ.h"

namespace trocar::app {

void print_text(const organ::Organ& organ);
void print_json(const organ::Organ& organ);

// Digits in groups of three: 12,345.
std::string grouped(std::size_t number);
const char* name_of(material::ElasticLaw law);

}  // namespace trocar::app
