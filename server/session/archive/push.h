#pragma once

// Brings a file to S3-compatible storage, whole or in parts. What was interrupted goes on: parts
// that are there already, by their length and MD5, are not sent again. Part kMostParts + 1 of an
// upload holds the SHA-256 of its file and goes into no object: an upload of another file, even of
// one that shares parts, is never gone on with. At the end the storage is asked for length and
// SHA-256 of what it has. Nothing there is ever replaced.

#include <cstdint>
#include <functional>
#include <string>

#include "common/base/result.h"
#include "server/session/archive/s3_client.h"

namespace trocar::archive {

inline constexpr std::uint64_t kLeastPartBytes = 5u << 20;  // S3 takes none smaller but the last
inline constexpr std::uint64_t kPartBytes = 16u << 20;
inline constexpr std::uint64_t kMostParts = 999;  // one answer lists 1000, the mark among them
inline constexpr const char* kChecksumHeader = "x-amz-meta-sha256";

struct PushOptions {
  std::uint64_t part_bytes = kPartBytes;  // larger where a file would have too many
  std::function<void(std::uint64_t sent, std::uint64_t of)> progress;
};

struct PushReport {
  std::uint64_t bytes = 0;
  std::uint64_t parts_sent = 0, parts_there = 0;  // a small file is one part
  bool was_there = false;                         // with that checksum
  std::string sha256;                             // hexadecimal
};

// The object of a file below a folder, or of that file alone: prefix and path with slashes.
std::string object_key(const std::string& prefix, const std::string& path);

// Errors: the file cannot be read or changes meanwhile, something else is there under that name, or
// the storage says no.
Result<PushReport> push_file(S3Client& client, const std::string& file, const std::string& key,
                             const PushOptions& options = {});

}  // namespace trocar::archive
