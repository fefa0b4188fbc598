#pragma once

// Files of Protocol Buffers look alike, whatever is in them: 8 bytes that say what they are, u32
// version, u64 length of the body when unpacked (at most 512 MiB), u32 CRC-32 of the unpacked body,
// then the body packed by zstd; numbers little-endian. No memory is taken for a length before that
// many bytes are there, and a file unpacks to 16 times its size and 16 MiB at most.

#include <filesystem>
#include <string_view>

#include "common/base/bytes.h"
#include "common/base/result.h"

namespace trocar::organ {

inline constexpr std::uint64_t kMaxPackedBodyBytes = std::uint64_t{512} << 20;

// For people, too.
struct PackedKind {
  std::string_view magic;   // 8 bytes
  std::string_view name;    // "an .organ file"
  std::string_view remedy;  // "make one with trocar-organ import"
  std::string_view again;   // "make or import it again", of another version
  std::uint32_t first_version, last_version;
};

struct PackedBody {
  std::uint32_t version = 0;
  Bytes body;
};

Bytes pack(const PackedKind& kind, std::uint32_t version, const Bytes& body);
// Error: another kind or version, cut off, or damaged. Does not name a file.
Result<PackedBody> unpack(const PackedKind& kind, BytesView file);

// Whether it is of that kind, sound or not.
bool has_magic(BytesView file, std::string_view magic);

// Writes beside the path and renames, so that a file is whole or not there.
Status write_packed(const std::filesystem::path& path, BytesView file);
// Error: missing, unreadable or too large; names the file.
Result<Bytes> read_packed(const std::filesystem::path& path);

}  // namespace trocar::organ
