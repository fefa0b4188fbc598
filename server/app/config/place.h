#pragma once

// Options that name where something listens or is reached.

#include <cstdint>
#include <string>

#include "common/base/result.h"

namespace trocar::app {

// Reads "ADDRESS:PORT", an IPv6 address in brackets, into `host` and `port`. An error begins with
// `option` and shows `example`; then nothing is set.
Status parse_place(const char* option, const char* example, const std::string& text,
                   std::string& host, std::uint16_t& port);

}  // namespace trocar::app
