// Peers' messages are read byte by byte, as they may be and as they may not; and messages to peers
// are as the definition of OpenIGTLink has them.

#include <gtest/gtest.h>
#include <igtlImageMessage.h>
#include <igtlPolyDataMessage.h>
#include <igtlTransformMessage.h>
#include <igtl_util.h>

#include <bit>
#include <cmath>
#include <limits>

#include "client/slicer/incoming.h"
#include "client/slicer/outgoing.h"
#include "client/slicer/scan_files.h"
#include "server/organs/label_map/nifti_reader.h"
#include "tests/support/files.h"

namespace trocar::slicer {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

// Writes numbers as the definition has them.
class Body {
 public:
  template <typename T>
  Body& put(T number) {
    auto bytes = std::bit_cast<std::array<std::uint8_t, sizeof(T)>>(number);
    std::reverse(bytes.begin(), bytes.end());
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
    return *this;
  }
  Body& put_text(std::string text, std::size_t size) {
    text.resize(size);
    bytes_.insert(bytes_.end(), text.begin(), text.end());
    return *this;
  }
  const Bytes& bytes() const { return bytes_; }

 private:
  Bytes bytes_;
};

std::uint64_t sum_of(const Bytes& bytes) {
  return crc64(const_cast<std::uint8_t*>(bytes.data()), bytes.size(), 0);
}

Header header_of(const std::string& type, const Bytes& body, std::uint16_t version = 1) {
  return {.version = version,
          .type = type,
          .device = "D",
          .body_bytes = body.size(),
          .crc = sum_of(body)};
}

template <typename T>
std::string complaint(const Result<T>& result) {
  return result ? "" : result.error().message;
}

struct ImageParts {
  std::uint8_t components = 1, type = 3, endian = 2, coordinates = 1;
  std::array<std::uint16_t, 3> size{2, 3, 4}, part_at{}, part{2, 3, 4};
  std::array<float, 12> matrix{1, 0, 0, 0, 2, 0, 0, 0, 3, 10, 20, 30};
};
Body image_body(const ImageParts& parts) {
  Body body;
  body.put(std::uint16_t{1});
  for (const auto byte : {parts.components, parts.type, parts.endian, parts.coordinates})
    body.put(byte);
  for (const auto number : parts.size) body.put(number);
  for (const auto number : parts.matrix) body.put(number);
  for (const auto number : parts.part_at) body.put(number);
  for (const auto number : parts.part) body.put(number);
  return body;
}
Bytes small_image(const ImageParts& parts = {}, std::uint8_t label = 7) {
  auto body = image_body(parts);
  for (int i = 0; i < 24; ++i) body.put(static_cast<std::uint8_t>(i == 5 ? label : 0));
  return body.bytes();
}

// Two triangles, the second as a strip of four corners that makes two.
Bytes small_surface(std::uint32_t corner = 2, float x = 0) {
  Body body;
  for (const std::uint32_t number : {4u, 0u, 0u, 0u, 0u, 1u, 16u, 1u, 20u, 0u}) body.put(number);
  for (const float number : {x, 0.f, 0.f, 1.f, 0.f, 0.f, 0.f, 1.f, 0.f, 1.f, 1.f, 0.f})
    body.put(number);
  for (const std::uint32_t number : {3u, 0u, 1u, corner}) body.put(number);
  for (const std::uint32_t number : {4u, 0u, 1u, 2u, 3u}) body.put(number);
  return body.bytes();
}

TEST(SlicerIncoming, AHeaderIsReadAsTheDefinitionHasIt) {
  Body body;
  body.put(std::uint16_t{2}).put_text("TRANSFORM", 12).put_text("Tool \x1b[2J", 20);
  body.put(std::uint64_t{5}).put(std::uint64_t{48}).put(std::uint64_t{0x0123456789abcdef});
  ASSERT_EQ(body.bytes().size(), kHeaderBytes);
  const auto header = read_header(body.bytes());
  ASSERT_TRUE(header);
  EXPECT_EQ(header->version, 2);
  EXPECT_EQ(header->kind(), Kind::Place);
  EXPECT_EQ(header->name(), "TRANSFORM 'Tool ?[2J'") << "a device's name gives no orders";
  EXPECT_EQ(header->body_bytes, 48u);
  EXPECT_EQ(header->crc, 0x0123456789abcdef);
  for (std::size_t size = 0; size < kHeaderBytes; ++size)
    EXPECT_FALSE(read_header(BytesView(body.bytes()).first(size))) << size;
}

TEST(SlicerIncoming, WhatIsNoOpenIgtLinkEndsTheConnection) {
  const std::string request = "GET / HTTP/1.1\r\nHost: localhost\r\nAccept: text/html, */*\r\n\r\n";
  EXPECT_NE(complaint(read_header(bytes_of(request))).find("version is 18245"), std::string::npos);
  Body body;
  body.put(std::uint16_t{1}).put_text("<html>", 12).put_text("", 20);
  for (int i = 0; i < 3; ++i) body.put(std::uint64_t{0});
  EXPECT_NE(complaint(read_header(body.bytes())).find("'<html>' is no name"), std::string::npos);
  Body long_one;
  long_one.put(std::uint16_t{1}).put_text("VIDEO", 12).put_text("", 20).put(std::uint64_t{0});
  long_one.put(kMostSkippedBytes + 1).put(std::uint64_t{0});
  EXPECT_NE(complaint(read_header(long_one.bytes())).find("body_size is 4294967297"),
            std::string::npos);
}

TEST(SlicerIncoming, SizesHaveLimitsByType) {
  for (const auto& [type, most] : std::vector<std::pair<std::string, std::uint64_t>>{
           {"TRANSFORM", 48}, {"STRING", 4 + kMostTextBytes}, {"IMAGE", 72 + kMostImageBytes}}) {
    constexpr std::uint64_t kMetadata = 64 * 1024;
    EXPECT_TRUE(check_size({.type = type, .device = "D", .body_bytes = most + kMetadata}));
    const auto refused =
        check_size({.type = type, .device = "D", .body_bytes = most + kMetadata + 1});
    ASSERT_FALSE(refused) << type;
    EXPECT_TRUE(refused.error().message.starts_with(type + " 'D': body_size is "))
        << refused.error().message;
  }
  EXPECT_TRUE(check_size({.type = "VIDEO", .device = "D", .body_bytes = 1 << 30}));
}

TEST(SlicerIncoming, TheSumIsCheckedAndMetadataOfVersion2IsPassedOver) {
  Body plain;
  plain.put(std::uint16_t{3}).put(std::uint16_t{2}).put_text("on", 2);
  auto header = header_of("STRING", plain.bytes());
  const auto content = content_of(header, plain.bytes());
  ASSERT_TRUE(content);
  EXPECT_EQ(*read_text(header, *content), "on");
  header.crc ^= 1;
  EXPECT_EQ(complaint(content_of(header, plain.bytes())),
            "STRING 'D': crc differs from that of the body");

  Body second;
  second.put(std::uint16_t{12}).put(std::uint16_t{10}).put(std::uint32_t{4}).put(std::uint32_t{0});
  second.put_text(std::string(plain.bytes().begin(), plain.bytes().end()), 6);
  second.put_text("", 10).put_text("key1", 4);
  header = header_of("STRING", second.bytes(), 2);
  const auto inner = content_of(header, second.bytes());
  ASSERT_TRUE(inner);
  EXPECT_EQ(*read_text(header, *inner), "on");
  for (std::size_t size = 0; size < second.bytes().size() - 6; ++size) {
    const Bytes cut(second.bytes().begin(), second.bytes().begin() + static_cast<long>(size));
    EXPECT_FALSE(content_of(header_of("STRING", cut, 2), cut)) << size;
  }
}

TEST(SlicerIncoming, TextsAreShortAndOfKnownEncoding) {
  const auto text = [](std::uint16_t encoding, std::uint16_t length, const std::string& letters) {
    Body body;
    body.put(encoding).put(length).put_text(letters, letters.size());
    return read_text({.type = "STRING", .device = "D"}, body.bytes());
  };
  EXPECT_EQ(*text(106, 4, "push"), "push");
  EXPECT_FALSE(text(3, 5, "push"));
  EXPECT_FALSE(text(3, 3, "push"));
  EXPECT_FALSE(text(4, 4, "push"));
  EXPECT_TRUE(text(3, 64, std::string(64, 'a')));
  EXPECT_FALSE(text(3, 65, std::string(65, 'a')));
  EXPECT_FALSE(read_text({.type = "STRING"}, Bytes{0, 3, 0}));
}

TEST(SlicerIncoming, ATransformIsWhatTheLibraryPacks) {
  const auto message = igtl::TransformMessage::New();
  igtl::Matrix4x4 matrix{{1, 2, 3, 10}, {4, 5, 6, 20}, {7, 8, 9, 30}, {0, 0, 0, 1}};
  message->SetMatrix(matrix);
  message->SetDeviceName("Stylus");
  message->Pack();
  const auto* bytes = static_cast<const std::uint8_t*>(message->GetPackPointer());
  const BytesView all(bytes, static_cast<std::size_t>(message->GetPackSize()));
  const auto header = read_header(all.first(kHeaderBytes));
  ASSERT_TRUE(header);
  const auto content = content_of(*header, all.subspan(kHeaderBytes));
  ASSERT_TRUE(content) << complaint(content);
  const auto transform = read_transform(*header, *content);
  ASSERT_TRUE(transform);
  EXPECT_EQ(*transform, (Transform{{{1, 2, 3, 10}, {4, 5, 6, 20}, {7, 8, 9, 30}}}));
  for (std::size_t size = 0; size < content->size(); ++size)
    EXPECT_FALSE(read_transform(*header, content->first(size))) << size;
}

TEST(SlicerIncoming, ALabelMapBecomesANiftiFileAtItsPlace) {
  ImageParts parts;
  parts.coordinates = 2;  // LPS
  const auto bytes = small_image(parts);
  const auto image = read_label_image(header_of("IMAGE", bytes), bytes);
  ASSERT_TRUE(image) << complaint(image);
  EXPECT_EQ(image->size, (std::array<int, 3>{2, 3, 4}));
  EXPECT_EQ(image->labels[5], 7);
  // The centre is at 10, 20, 30 (LPS), and voxels of 1 x 2 x 3 mm are around it.
  EXPECT_EQ(image->origin_mm, (Vec3d{-9.5, -18, 25.5}));
  EXPECT_EQ(image->steps_mm[0], (Vec3d{-1, 0, 0}));
  const testing::TemporaryFolder folder;
  const auto path = folder.file("map.nii");
  ASSERT_TRUE(write_label_map(path, *image));
  const auto read = label_map::read_nifti(path, std::nullopt);
  ASSERT_TRUE(read) << complaint(read);
  EXPECT_TRUE(read->warnings.empty()) << read->warnings.front();
  EXPECT_EQ(read->orientation, "LPS");
  EXPECT_EQ(read->labels, image->labels);
  // Left, head, front, m.
  EXPECT_NEAR(read->origin_m.x, 9.5e-3, 1e-9);
  EXPECT_NEAR(read->origin_m.y, 25.5e-3, 1e-9);
  EXPECT_NEAR(read->origin_m.z, -18e-3, 1e-9);
}

TEST(SlicerIncoming, ALabelMapThatIsNoneIsRefused) {
  const auto refusal = [](const ImageParts& parts) {
    const auto bytes = small_image(parts);
    return complaint(read_label_image(header_of("IMAGE", bytes), bytes));
  };
  EXPECT_EQ(refusal({}), "");
  EXPECT_EQ(refusal({.components = 3}), "IMAGE 'D': has 3 components, a label map has 1");
  EXPECT_NE(refusal({.type = 8}).find("scalar_type is 8"), std::string::npos);
  EXPECT_NE(refusal({.type = 5}).find("has 24 bytes of voxels, must be 48"), std::string::npos);
  EXPECT_NE(refusal({.endian = 0}).find("endian is 0"), std::string::npos);
  EXPECT_NE(refusal({.coordinates = 3}).find("coord is 3"), std::string::npos);
  EXPECT_NE(refusal({.size = {24, 1, 1}}).find("must be 2 or more"), std::string::npos);
  EXPECT_NE(refusal({.size = {65535, 65535, 65535}}).find("allowed are 67108864 voxels"),
            std::string::npos);
  EXPECT_NE(refusal({.part = {1, 3, 4}}).find("comes whole"), std::string::npos);
  EXPECT_NE(refusal({.part_at = {1, 0, 0}}).find("comes whole"), std::string::npos);
  ImageParts bad;
  bad.matrix[4] = kNan;
  EXPECT_NE(refusal(bad).find("not finite"), std::string::npos);
  const auto empty = small_image({}, 0);
  EXPECT_NE(complaint(read_label_image(header_of("IMAGE", empty), empty)).find("empty"),
            std::string::npos);
  for (const float voxel : {kNan, -1.0f, 0.5f, 65536.0f}) {
    auto body = image_body({.type = 10, .endian = 1});
    for (int i = 0; i < 24; ++i) body.put(i == 3 ? voxel : 1.0f);
    EXPECT_NE(complaint(read_label_image(header_of("IMAGE", body.bytes()), body.bytes()))
                  .find("voxel 3 is"),
              std::string::npos)
        << voxel;
  }
  const auto whole = small_image();
  for (std::size_t size = 0; size < whole.size(); ++size)
    EXPECT_FALSE(read_label_image(header_of("IMAGE", whole), BytesView(whole).first(size)));
}

TEST(SlicerIncoming, ASurfaceIsCutIntoTriangles) {
  const auto bytes = small_surface();
  const auto surface = read_surface(header_of("POLYDATA", bytes), bytes);
  ASSERT_TRUE(surface) << complaint(surface);
  EXPECT_EQ(surface->points_mm.size(), 4u);
  using Triangles = std::vector<std::array<std::uint32_t, 3>>;
  EXPECT_EQ(surface->triangles, (Triangles{{0, 1, 2}, {0, 1, 2}, {2, 1, 3}}));
  for (std::size_t size = 0; size < bytes.size(); ++size)
    EXPECT_FALSE(read_surface(header_of("POLYDATA", bytes), BytesView(bytes).first(size))) << size;
  const auto refusal = [](const Bytes& body) {
    return complaint(read_surface(header_of("POLYDATA", body), body));
  };
  EXPECT_EQ(refusal(small_surface(4)), "POLYDATA 'D': polygons 0 names point 4, there are 4");
  EXPECT_EQ(refusal(small_surface(2, kNan)), "POLYDATA 'D': point 0 is not finite");
  Body many;
  for (const std::uint32_t number : {300'001u, 0u, 0u, 0u, 0u, 1u, 16u, 0u, 0u, 0u})
    many.put(number);
  EXPECT_NE(refusal(many.bytes()).find("npoints is 300001, allowed are 1 to 300000"),
            std::string::npos);
  // Sizes that overflow 32 bits together.
  Body wide;
  for (const std::uint32_t number : {1u, 1u, ~0u, 1u, ~0u, ~0u, ~0u, 0u, 0u, 0u}) wide.put(number);
  for (int i = 0; i < 3; ++i) wide.put(0.0f);
  EXPECT_NE(refusal(wide.bytes()).find("size_vertices"), std::string::npos);
}

TEST(SlicerOutgoing, MessagesAreAsTheDefinitionHasThem) {
  const auto message = transform_message("Ada_R", {{{1, 2, 3, 10}, {4, 5, 6, 20}, {7, 8, 9, 30}}});
  Body expected;
  for (const int number : {1, 4, 7, 2, 5, 8, 3, 6, 9, 10, 20, 30})
    expected.put(static_cast<float>(number));
  ASSERT_EQ(message->size(), kHeaderBytes + 48);
  EXPECT_EQ(Bytes(message->begin() + kHeaderBytes, message->end()), expected.bytes());
  const auto header = read_header(BytesView(*message).first(kHeaderBytes));
  ASSERT_TRUE(header);
  EXPECT_EQ(header->name(), "TRANSFORM 'Ada_R'");
  EXPECT_EQ(header->version, 1);
  EXPECT_EQ(header->crc, sum_of(expected.bytes()));

  const auto text = text_message("Ada_R_force", "0.412 N");
  Body letters;
  letters.put(std::uint16_t{3}).put(std::uint16_t{7}).put_text("0.412 N", 7);
  EXPECT_EQ(Bytes(text->begin() + kHeaderBytes, text->end()), letters.bytes());
}

TEST(SlicerOutgoing, ASurfaceHasItsTrianglesAndWhichAreWounds) {
  const std::vector<Vec3f> points{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {9, 9, 9}};
  const std::vector<std::array<std::uint32_t, 3>> triangles{{0, 1, 2}, {0, 0, 0}, {3, 1, 2}};
  const std::vector<std::uint8_t> wounds{0, 0, 1};
  const auto message = surface_message("S", {points, triangles, wounds});
  Body expected;
  for (const std::uint32_t number : {4u, 0u, 0u, 0u, 0u, 2u, 32u, 0u, 0u, 1u}) expected.put(number);
  for (const auto& p : points) expected.put(p.x).put(p.y).put(p.z);
  for (const std::uint32_t number : {3u, 0u, 1u, 2u, 3u, 3u, 1u, 2u}) expected.put(number);
  const Bytes body(message->begin() + kHeaderBytes, message->end());
  ASSERT_GT(body.size(), expected.bytes().size());
  EXPECT_TRUE(std::equal(expected.bytes().begin(), expected.bytes().end(), body.begin()));
  Body attribute;  // of points, a scalar of one component, four of them
  attribute.put(std::uint8_t{0}).put(std::uint8_t{1}).put(std::uint32_t{4}).put_text("wound", 6);
  for (const float number : {0.f, 1.f, 1.f, 1.f}) attribute.put(number);
  EXPECT_EQ(Bytes(body.begin() + static_cast<long>(expected.bytes().size()), body.end()),
            attribute.bytes());
}

}  // namespace
}  // namespace trocar::slicer
