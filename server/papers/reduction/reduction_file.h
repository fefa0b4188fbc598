#pragma once

// `.reduction` files: a packed file (server/organs/organ/packed_file.h) with the magic "TROCARR1"
// and one proto Reduction message (proto/reduction.proto). Nothing in a file is trusted: any bytes
// give a reduction that validate() accepts, or an error of one line.

#include <filesystem>

#include "common/base/bytes.h"
#include "server/papers/reduction/reduction.h"

namespace trocar::reduction {

inline constexpr std::string_view kReductionMagic = "TROCARR1";

Status write_reduction(const std::filesystem::path& path, const Reduction& reduction);
// Refuses one of another organ, too.
Result<Reduction> read_reduction(const std::filesystem::path& path, const organ::Organ& organ);

// A file's content. Errors do not name a file; unpack_reduction() does not know the organ.
Bytes pack_reduction(const Reduction& reduction);
Result<Reduction> unpack_reduction(BytesView file);

}  // namespace trocar::reduction
