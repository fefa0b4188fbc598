#pragma once

// A copy of a recording without the names of people.
//
// Each name becomes "Person 1", "Person 2", ... in the order in which they appear: in lists, in
// claims, and within sentences. Talk, notes, reasons and names of marks, which people typed, are
// taken out, or kept but for names. Names of other recordings are taken out. What a text says is in
// recorded_texts.h; what is not listed there is taken out. Nothing that is simulated changes, so
// the copy verifies as the recording does. Motions stay as they were, and may tell who moved. A
// metadata record says what was done.
//
//   trocar.anonymised   people, and words: "taken out" or "kept"

#include <string>

#include "common/base/result.h"

namespace trocar::recording {

inline constexpr const char* kAnonymisedMetadataName = "trocar.anonymised";

struct AnonymiseReport {
  std::size_t people = 0;   // names that were replaced
  std::uint64_t words = 0;  // messages with words that people typed
};

// `to` must not exist. Error: `from` is cut short or damaged.
Result<AnonymiseReport> anonymise(const std::string& from, const std::string& to, bool keeps_words);

}  // namespace trocar::recording
