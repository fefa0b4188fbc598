#pragma once

// `.organ` files, and an organ as bytes (the journal keeps one of those).
//
// File: 8 bytes "TROCARO1", u32 version, u64 length of the body when unpacked (at most 512 MiB),
// u32 CRC-32 of the unpacked body, then the body packed by zstd; numbers little-endian. The
// unpacked body is what encode_organ() gives: one proto Organ message (proto/organ.proto). Derived
// lists are not stored; they are rebuilt, and the whole organ is validated, before anybody sees it.
// Node numbers are kept. Nothing in a file is trusted: any bytes give an organ that validate()
// accepts, or an error, and no memory is taken for a length before that many bytes are there.

#include <filesystem>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "server/organs/organ/organ.h"

namespace trocar::organ {

Bytes encode_organ(const Organ& organ);
Result<Organ> decode_organ(BytesView bytes);

// Error: the name does not end with .organ. So an organ never takes the place of what it was made
// from, such as a scan.
Status check_organ_name(const std::filesystem::path& path);
// Writes beside the path and renames, so that a file is whole or not there.
Status write_organ(const std::filesystem::path& path, const Organ& organ);
Result<Organ> read_organ(const std::filesystem::path& path);

// A file's content, for read_organ() and its tests. Errors do not name a file.
Bytes pack_organ(const Organ& organ);
Result<Organ> unpack_organ(BytesView file);

}  // namespace trocar::organ
