#pragma once

// The surgical threads of a frame: server, clients, recordings and pages agree on them bit for bit.
// Each frame stands alone, so no loss harms the next, and who comes late has all at once.
//
// Layout: varint threads, for each varint nodes and u8 material;
//   varint pegs, for each seven zig-zag varints: x, y, z of both ends and the radius, in quanta;
//   varint parted segments, for each a varint: the node before it, less that of the one before;
//   the places in quanta, world frame, as differences from where the two nodes before them point.
//   The first node is told from the origin. Per block of 16 nodes four bits, the Rice parameter,
//   then x, y, z of each in zig-zag; a quotient of 16 or more is 16 ones and 24 plain bits.
// Laid out thread takes about 1 byte a node, in knots up to 2.

#include <cstdint>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/wire/quantise.h"

namespace trocar::wire {

// These are the limits of the server's threads (server/tissue/thread/rules.h).
inline constexpr std::size_t kMostThreads = 8, kMostThreadPegs = 32, kMostThreadNodes = 1200;
inline constexpr std::size_t kLeastThreadNodes = 4;  // of one thread
inline constexpr std::uint8_t kThreadMaterials = 4;  // silk, nylon, polyglactin, polypropylene
inline constexpr float kThreadMetres = 0.5e-3f;      // thick, for other thread and for the eye
inline constexpr std::int32_t kMostThreadQuanta = (1 << 17) - 1;  // 4.2 m from the origin

struct ThreadEntry {
  std::uint32_t nodes = 0;
  std::uint8_t material = 0;

  bool operator==(const ThreadEntry&) const = default;
};
// A rigid capsule that stands still.
struct ThreadPeg {
  QuantisedVertex from, to;
  std::int32_t radius = 0;  // quanta, 1 or more

  bool operator==(const ThreadPeg&) const = default;
};
struct ThreadPicture {
  std::vector<ThreadEntry> threads;
  std::vector<ThreadPeg> pegs;
  std::vector<QuantisedVertex> places;  // of all threads' nodes, one thread after the other
  std::vector<std::uint8_t> is_joined;  // per node: to the next one

  bool operator==(const ThreadPicture&) const = default;
};

// Rounded, and at most kMostThreadQuanta away along each axis. The place is finite.
QuantisedVertex quantised_place(const Vec3d& place_m);

// Appends. The picture is within the limits above.
void encode_threads(const ThreadPicture& picture, Bytes& out);

// Outside data: an error names what is wrong. Trailing bytes are wrong, too.
Result<ThreadPicture> decode_threads(BytesView payload);

}  // namespace trocar::wire
