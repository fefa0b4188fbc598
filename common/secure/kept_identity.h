#pragma once

// The certificate and key that a program shows: those of given files, or its own in its state
// folder, which is made at the first start and used from then on.

#include <filesystem>
#include <string>

#include "common/base/result.h"
#include "common/secure/certificate.h"

namespace trocar::secure {

struct KeptIdentity {
  Identity identity;
  std::string source;  // as errors about it name it
};

// Reads both files of --certificate and --key, if they are given, or NAME.crt and NAME.key in
// `folder`, which is a private one and where they are made if they are missing. An error names the
// file that cannot be read or written. The log warns of a given key that others can read.
Result<KeptIdentity> read_or_make_identity(const std::string& certificate_file,
                                           const std::string& key_file,
                                           const std::filesystem::path& folder,
                                           const std::string& name);

}  // namespace trocar::secure
