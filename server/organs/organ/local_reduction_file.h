#pragma once

// `.reduction` files of the method local: a packed file (packed_file.h) with the magic "TROCARL1"
// and one proto LocalReduction message (proto/local_reduction.proto). Those of the method dogan
// are in server/papers/dogan/reduction_file.h. Nothing in a file is trusted: any bytes give a
// reduction that validate() accepts, or an error of one line.

#include <filesystem>
#include <string_view>

#include "common/base/bytes.h"
#include "server/organs/organ/local_reduction.h"
#include "server/organs/organ/packed_file.h"

namespace trocar::organ {

inline constexpr std::string_view kLocalReductionMagic = "TROCARL1";
// The magic of the other method's files, which sessions refuse by name.
inline constexpr std::string_view kDoganReductionMagic = "TROCARR1";

// Error, too: it is larger than a packed file may be.
Status write_local_reduction(const std::filesystem::path& path, const LocalReduction& reduction);
// Refuses one of another organ, too.
Result<LocalReduction> read_local_reduction(const std::filesystem::path& path, const Organ& organ);
// Does the same as read_local_reduction(), for sessions: it refuses also an organ that they can
// have none of, and one of another density.
Result<LocalReduction> read_session_reduction(const std::filesystem::path& path,
                                              const Organ& organ);

// A file's content. Errors do not name a file; unpack_local_reduction() does not know the organ.
Result<Bytes> pack_local_reduction(const LocalReduction& reduction,
                                   std::uint64_t max_body_bytes = kMaxPackedBodyBytes);
Result<LocalReduction> unpack_local_reduction(BytesView file);

}  // namespace trocar::organ
