#include "client/slicer/incoming.h"

#include <fmt/format.h>
#include <igtl_util.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "client/slicer/big_endian.h"
#include "common/base/printable.h"

namespace trocar::slicer {
namespace {

constexpr std::size_t kTypeBytes = 12, kNameBytes = 20, kTransformBytes = 48;
constexpr std::size_t kTextHeaderBytes = 4, kExtendedBytes = 12;
// Beyond its content, a body of version 2 may hold metadata.
constexpr std::uint64_t kMostMetadata = 64 * 1024;

std::string text_at(BytesView bytes, std::size_t at, std::size_t size) {
  const auto field = bytes.subspan(at, size);
  const auto end = std::find(field.begin(), field.end(), std::uint8_t{0});
  return printable(std::string(field.begin(), end), size);
}

std::uint64_t most_body_bytes(Kind kind) {
  switch (kind) {
    case Kind::Place:
      return kTransformBytes + kMostMetadata;
    case Kind::Text:
      return kTextHeaderBytes + kMostTextBytes + kMostMetadata;
    case Kind::LabelMap:
      return kImageHeaderBytes + kMostImageBytes + kMostMetadata;
    case Kind::Surface:
      return kSurfaceHeaderBytes + kMostSurfaceBytes + kMostMetadata;
    case Kind::Other:
      break;
  }
  return kMostSkippedBytes;
}

}  // namespace

Kind Header::kind() const {
  if (type == "TRANSFORM") return Kind::Place;
  if (type == "STRING") return Kind::Text;
  if (type == "IMAGE") return Kind::LabelMap;
  if (type == "POLYDATA") return Kind::Surface;
  return Kind::Other;
}

std::string Header::name() const {
  return type + " '" + device + "'";
}

Error wrong(const Header& header, const std::string& what) {
  return {ErrorCode::BadMessage, header.name() + ": " + what};
}

Result<Header> read_header(BytesView bytes) {
  BigEndian in(bytes);
  Header header;
  header.version = in.read<std::uint16_t>();
  header.type = text_at(bytes, 2, kTypeBytes);
  header.device = text_at(bytes, 2 + kTypeBytes, kNameBytes);
  in.skip(kTypeBytes + kNameBytes + sizeof(std::uint64_t));  // and the time
  header.body_bytes = in.read<std::uint64_t>();
  header.crc = in.read<std::uint64_t>();
  if (!in.ok()) return Error{ErrorCode::BadMessage, "header: has less than 58 bytes"};
  if (header.version < 1 || header.version > 2)
    return Error{ErrorCode::BadMessage,
                 fmt::format("header: version is {}, known are 1 and 2: this is not OpenIGTLink",
                             header.version)};
  const auto is_of_type = [](char c) {
    return (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
  };
  if (header.type.empty() || !std::all_of(header.type.begin(), header.type.end(), is_of_type))
    return Error{ErrorCode::BadMessage,
                 "header: type '" + header.type + "' is no name: this is not OpenIGTLink"};
  if (header.body_bytes > kMostSkippedBytes)
    return wrong(header, fmt::format("body_size is {}, allowed are {}", header.body_bytes,
                                     kMostSkippedBytes));
  return header;
}

Status check_size(const Header& header) {
  const auto most = most_body_bytes(header.kind());
  if (header.body_bytes <= most) return {};
  return wrong(header,
               fmt::format("body_size is {} bytes, allowed are {}", header.body_bytes, most));
}

Result<BytesView> content_of(const Header& header, BytesView body) {
  // The library's own sum; it does not write to what it is given.
  const auto sum = crc64(const_cast<std::uint8_t*>(body.data()), body.size(), 0);
  if (sum != header.crc) return wrong(header, "crc differs from that of the body");
  if (header.version < 2) return body;
  BigEndian in(body);
  const std::uint64_t extended = in.read<std::uint16_t>();
  const std::uint64_t metadata_header = in.read<std::uint16_t>();
  const std::uint64_t metadata = in.read<std::uint32_t>();
  if (!in.ok() || extended < kExtendedBytes || extended + metadata_header + metadata > body.size())
    return wrong(header,
                 fmt::format("the extended header says {}, {} and {} bytes, the body has {}",
                             extended, metadata_header, metadata, body.size()));
  return body.subspan(extended, body.size() - extended - metadata_header - metadata);
}

Result<Transform> read_transform(const Header& header, BytesView content) {
  if (content.size() != kTransformBytes)
    return wrong(header,
                 fmt::format("matrix has {} bytes, must be {}", content.size(), kTransformBytes));
  BigEndian in(content);
  Transform transform{};
  for (std::size_t column = 0; column < 4; ++column)
    for (auto& row : transform) row[column] = in.read<float>();
  return transform;
}

Result<std::string> read_text(const Header& header, BytesView content) {
  BigEndian in(content);
  const auto encoding = in.read<std::uint16_t>();
  const std::size_t length = in.read<std::uint16_t>();
  if (!in.ok() || length != in.remaining() || length > kMostTextBytes)
    return wrong(header, fmt::format("length is {}, there are {} bytes, allowed are {}", length,
                                     in.remaining(), kMostTextBytes));
  // US-ASCII and UTF-8, as the IANA numbers them.
  if (encoding != 3 && encoding != 106)
    return wrong(header, fmt::format("encoding is {}, must be 3 or 106", encoding));
  const auto bytes = in.rest();
  return printable(std::string(bytes.begin(), bytes.end()), kMostTextBytes);
}

}  // namespace trocar::slicer
