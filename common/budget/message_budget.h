#pragma once

// How much memory a message of Protocol Buffers would take, before it is parsed.
//
// Few bytes can stand for much memory: an empty message in a list takes two bytes and more than a
// hundred in memory, and a packed list of small numbers four times its bytes. The fields are walked
// without being kept, and counted against a budget; what a field would take is rounded up. Unknown
// fields are kept by the library, so they count, too.

#include <google/protobuf/descriptor.h>

#include <cstddef>

#include "common/base/bytes.h"
#include "common/base/result.h"

namespace trocar {

// Sixteen times a file's or message's bytes, and 16 MiB.
constexpr std::size_t build_budget(std::size_t bytes) {
  return 16 * bytes + (std::size_t{16} << 20);
}

// Error: malformed, or more than `budget_bytes`.
Status check_budget(const google::protobuf::Descriptor& type, BytesView message,
                    std::size_t budget_bytes);

}  // namespace trocar
