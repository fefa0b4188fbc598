#pragma once

// Reader of OpenIGTLink messages from peers that nobody vouches for.
//
// A message is a header of 58 bytes and a body, big-endian. Read are TRANSFORM, STRING, IMAGE and
// POLYDATA, in headers of version 1 and of version 2, whose extended header and metadata are passed
// over. Errors are one line that names message, device, field and limit. No memory is taken for a
// number that a message announces. Functions without state; any thread.
//
// Source: OpenIGTLink protocol, version 2 and 3 (openigtlink.org).

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "client/slicer/frames.h"
#include "common/base/bytes.h"
#include "common/base/result.h"

namespace trocar::slicer {

inline constexpr std::size_t kHeaderBytes = 58;
inline constexpr std::size_t kMostVoxels = std::size_t{64} << 20;  // of a label map
inline constexpr std::size_t kMostImageBytes = std::size_t{128} << 20;
inline constexpr std::size_t kMostSurfaceTriangles = 200'000, kMostSurfacePoints = 300'000;
inline constexpr std::size_t kMostTextBytes = 64;
// A body that is only passed over.
inline constexpr std::uint64_t kMostSkippedBytes = std::uint64_t{1} << 32;

enum class Kind : std::uint8_t { Place, Text, LabelMap, Surface, Other };

struct Header {
  std::uint16_t version = 1;
  std::string type, device;  // printable
  std::uint64_t body_bytes = 0, crc = 0;

  Kind kind() const;
  // Returns how errors name the message: "TRANSFORM 'Stylus'".
  std::string name() const;
};

// Error: these are no OpenIGTLink messages, so nothing behind them can be found any more.
Result<Header> read_header(BytesView bytes);
// Error: the body is longer than such a message may be. The next message can be found behind it.
Status check_size(const Header& header);
// The body without what version 2 adds. Error: the checksum differs, or sizes do not fit.
Result<BytesView> content_of(const Header& header, BytesView body);

// All take content. Errors name the message.
Result<Transform> read_transform(const Header& header, BytesView content);
Result<std::string> read_text(const Header& header, BytesView content);

// Whole numbers from 0 to 65535, i fastest. Places are centres of voxels in RAS, mm.
struct LabelImage {
  std::array<int, 3> size{};
  std::vector<std::uint16_t> labels;
  std::array<Vec3d, 3> steps_mm{};
  Vec3d origin_mm;
};
// Error: besides, it has several components, is a part of an image, holds fractions or numbers
// beyond 0 to 65535, has no more than one voxel along an axis, or its steps are not finite.
Result<LabelImage> read_label_image(const Header& header, BytesView content);

struct SurfaceMesh {
  std::vector<Vec3f> points_mm;  // RAS
  std::vector<std::array<std::uint32_t, 3>> triangles;
};
// Polygons are cut into fans, and strips into triangles. Points, lines and attributes are passed
// over.
Result<SurfaceMesh> read_surface(const Header& header, BytesView content);

}  // namespace trocar::slicer
