#pragma once

// Writes a recording again with a signature, so that whoever has the public key can check whose it
// is and that all of it is there.

#include <string>

#include "common/base/result.h"
#include "common/secure/signing.h"

namespace trocar::recording {

struct SignReport {
  std::uint64_t messages = 0;
  std::string note;  // what could not be checked before it was signed; empty: nothing
};

// `to` must not exist. Error: the recording is cut short or damaged, was changed since it was
// recorded, or cannot be written.
Result<SignReport> sign(const std::string& from, const std::string& to,
                        const secure::SigningKey& key);

}  // namespace trocar::recording
