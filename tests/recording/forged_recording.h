#pragma once

// Recordings that somebody changed, with index, summary and CRCs that are right again.

#include <functional>
#include <string>

#include "common/journal/mcap_reader.h"

namespace trocar::recording::testing {

// Each may change what it is given; false: it is left out.
using KeepsMessage = std::function<bool(const journal::McapChannel&, journal::McapMessage&)>;
using KeepsMetadata = std::function<bool(journal::McapMetadata&)>;

const auto kAllMessages = [](const journal::McapChannel&, const journal::McapMessage&) {
  return true;
};
const auto kAllMetadata = [](const journal::McapMetadata&) { return true; };

// Writes some of a recording again.
void forge(const std::string& from, const std::string& to, const KeepsMessage& keeps,
           const KeepsMetadata& keeps_metadata = kAllMetadata);

}  // namespace trocar::recording::testing
