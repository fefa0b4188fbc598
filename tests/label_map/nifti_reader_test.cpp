#include "server/organs/label_map/nifti_reader.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "tests/label_map/nifti_sample.h"

namespace trocar::label_map {
namespace {

using testing::nifti;
using testing::put;

std::string small() {
  return nifti({3, 4, 5}, 2, [](int i, int j, int k) { return i + 3 * j + 12 * k; });
}
Result<LabelMap> parse(const std::string& file, std::optional<mesh::Unit> unit = {}) {
  return parse_nifti(file, unit, "a.nii");
}
std::string error_of(const std::string& file, std::optional<mesh::Unit> unit = {}) {
  const auto result = parse(file, unit);
  return result.ok() ? "accepted" : result.error().message;
}

TEST(NiftiReader, ReadsLabelsPlaceAndUnit) {
  const auto map = parse(small());
  ASSERT_TRUE(map.ok()) << map.error().message;
  EXPECT_EQ(map->size, (std::array{3, 4, 5}));
  EXPECT_EQ(map->labels[map->index(1, 2, 3)], 1 + 6 + 36);
  EXPECT_EQ(map->orientation, "RAS");
  EXPECT_TRUE(map->warnings.empty());
  // The file's right is at -x, its front at z, its head at y.
  EXPECT_NEAR(length(map->origin_m - Vec3d{-0.01, 0, 0}), 0, 1e-9);
  EXPECT_NEAR(length(map->steps_m[0] - Vec3d{-0.002, 0, 0}), 0, 1e-9);
  EXPECT_NEAR(length(map->steps_m[1] - Vec3d{0, 0, 0.002}), 0, 1e-9);
  EXPECT_NEAR(length(map->steps_m[2] - Vec3d{0, 0.002, 0}), 0, 1e-9);
}

TEST(NiftiReader, TheQformTurnsVoxelsAsTheSformDoes) {
  auto file = small();
  put(file, 254, std::int16_t{0});
  put(file, 252, std::int16_t{1});
  // A half turn around the head's axis: quaternion (0, 0, 0, 1), that is d = 1.
  put(file, 264, 1.0f);
  put(file, 268, 10.0f);
  const auto map = parse(file);
  ASSERT_TRUE(map.ok()) << map.error().message;
  EXPECT_EQ(map->orientation, "LPS");
  EXPECT_NEAR(length(map->steps_m[0] - Vec3d{0.002, 0, 0}), 0, 1e-9);
  put(file, 76, -1.0f);
  EXPECT_EQ(parse(file)->orientation, "LPI");
}

TEST(NiftiReader, SaysWhatTheFileLeavesOpen) {
  auto file = small();
  put(file, 254, std::int16_t{0});
  put(file, 123, char{0});
  const auto map = parse(file);
  ASSERT_TRUE(map.ok()) << map.error().message;
  ASSERT_EQ(map->warnings.size(), 2u);
  EXPECT_NE(map->warnings[0].find("no unit of length, taken as mm"), std::string::npos);
  EXPECT_NE(map->warnings[1].find("which side is left is not known"), std::string::npos);
  EXPECT_EQ(parse(file, mesh::Unit::Centimetre)->warnings.size(), 1u);
}

TEST(NiftiReader, SaysWhereSformAndQformDisagree) {
  const auto warnings_of = [](const std::string& file) {
    const auto map = parse(file);
    return map.ok() && map->warnings.size() == 1 ? map->warnings[0] : "another number of warnings";
  };
  // The sform of the sample without a turn, which a qform says likewise.
  auto file = small();
  put(file, 252, std::int16_t{1});
  for (const int d : {1, 2, 3}) put(file, static_cast<std::size_t>(76 + 4 * d), 2.0f);
  put(file, 268, 10.0f);
  EXPECT_TRUE(parse(file)->warnings.empty());
  put(file, 268, 15.0f);
  EXPECT_EQ(warnings_of(file), "sform and qform disagree by up to 5 mm: sform was taken");
  put(file, 264, 1.0f);
  EXPECT_EQ(warnings_of(file),
            "sform and qform disagree about the sides: sform says RAS, qform LPS; sform was taken");
  put(file, 264, 2.0f);
  EXPECT_EQ(warnings_of(file),
            "sform and qform disagree: qform gives no position, sform was taken");
}

TEST(NiftiReader, ASlopeOfZeroScalesNothing) {
  auto file = small();
  put(file, 112, 0.0f);
  put(file, 116, 7.0f);
  ASSERT_TRUE(parse(file).ok()) << error_of(file);
  EXPECT_EQ(parse(file)->labels, parse(small())->labels);
}

std::string gzip(const std::string& text) {
  std::string packed(compressBound(text.size()) + 64, '\0');
  z_stream stream{};
  EXPECT_EQ(deflateInit2(&stream, 9, Z_DEFLATED, 16 + MAX_WBITS, 8, Z_DEFAULT_STRATEGY), Z_OK);
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
  stream.avail_in = static_cast<uInt>(text.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  return packed;
}

TEST(NiftiReader, ReadsAllMembersOfAGzipFile) {
  const auto file = small();
  const auto packed = gzip(file.substr(0, 360)) + gzip("") + gzip(file.substr(360));
  for (const auto& text : {packed, packed + std::string(512, '\0')}) {
    ASSERT_TRUE(parse(text).ok()) << error_of(text);
    EXPECT_EQ(parse(text)->labels, parse(file)->labels);
  }
  EXPECT_NE(error_of(packed + "rest").find("damaged or cut off"), std::string::npos);
}

TEST(NiftiReader, ReadsGzipAndOtherTypes) {
  const auto file = small();
  const auto packed = gzip(file);
  const auto map = parse(packed);
  ASSERT_TRUE(map.ok()) << map.error().message;
  EXPECT_EQ(map->labels, parse(file)->labels);
  EXPECT_NE(error_of(packed.substr(0, packed.size() / 2)).find("damaged or cut off"),
            std::string::npos);

  auto floats = file.substr(0, 352);
  put(floats, 70, std::int16_t{16});
  for (std::size_t i = 352; i < file.size(); ++i) {
    const auto value = static_cast<float>(file[i]);
    floats.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  EXPECT_EQ(parse(floats)->labels, parse(file)->labels);
  put(floats, 352 + 4 * 5, 2.5f);
  EXPECT_NE(error_of(floats).find("voxel (2, 1, 0) is no label"), std::string::npos);
}

// A file of 16 bits has 300 voxels with so many values beside 0.
std::string of_values(int values) {
  auto file = nifti({10, 10, 3}, 2, [](int, int, int) { return 0; }).substr(0, 352);
  put(file, 70, std::int16_t{4});
  for (int i = 0; i < 300; ++i) {
    const auto value = static_cast<std::int16_t>(10 * (i % (values + 1)));
    file.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  return file;
}

TEST(NiftiReader, AScanOfGreyValuesIsRefused) {
  EXPECT_TRUE(parse(of_values(256)).ok()) << error_of(of_values(256));
  EXPECT_EQ(error_of(of_values(257)),
            "a.nii: has more than 256 values: it holds grey values, not labels, so segment it "
            "first, in 3D Slicer for instance");
}

TEST(NiftiReader, ReadsBothByteOrders) {
  auto file = nifti({10, 10, 3}, 2, [](int, int, int) { return 0; }).substr(0, 352);
  put(file, 70, std::int16_t{4});
  for (int i = 0; i < 300; ++i) {
    const auto value = static_cast<std::int16_t>(300 * (i % 2));
    file.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  const auto own = parse(file);
  const auto turn = [&file](std::size_t begin, std::size_t end, std::ptrdiff_t size) {
    for (auto at = file.begin() + static_cast<std::ptrdiff_t>(begin);
         at < file.begin() + static_cast<std::ptrdiff_t>(end); at += size)
      std::reverse(at, at + size);
  };
  turn(0, 4, 4);
  turn(40, 56, 2);
  turn(68, 76, 2);
  turn(76, 120, 4);
  turn(252, 256, 2);
  turn(256, 328, 4);
  turn(352, file.size(), 2);
  const auto other = parse(file);
  ASSERT_TRUE(own.ok() && other.ok()) << error_of(file);
  EXPECT_EQ(other->size, own->size);
  EXPECT_EQ(other->labels, own->labels);
  EXPECT_EQ(other->labels[1], 300);
  EXPECT_EQ(other->orientation, own->orientation);
}

TEST(NiftiReader, ReadsTheSecondVersion) {
  const auto label = [](int i, int j, int k) { return (i + j + k) % 3; };
  const auto own = parse(nifti({5, 4, 3}, 2, label));
  std::string file(544, '\0');
  put(file, 0, std::int32_t{540});
  std::memcpy(file.data() + 4, "n+2\0\r\n\032\n", 8);
  put(file, 12, std::int16_t{2});
  const std::int64_t dim[] = {3, 5, 4, 3};
  for (std::size_t d = 0; d < 4; ++d) put(file, 16 + 8 * d, dim[d]);
  for (std::size_t d = 0; d < 4; ++d) put(file, 104 + 8 * d, d == 0 ? 1.0 : 2.0);
  put(file, 168, std::int64_t{544});
  put(file, 348, std::int32_t{1});
  for (std::size_t d = 0; d < 3; ++d) put(file, 400 + 40 * d, 2.0);  // diagonal of the sform
  put(file, 424, 10.0);
  put(file, 500, std::int32_t{2});
  file += nifti({5, 4, 3}, 2, label).substr(352);
  const auto other = parse(file);
  ASSERT_TRUE(own.ok() && other.ok()) << error_of(file);
  EXPECT_EQ(other->labels, own->labels);
  EXPECT_EQ(other->size, own->size);
  EXPECT_EQ(other->orientation, own->orientation);
  EXPECT_EQ(other->origin_m, own->origin_m);
  put(file, 16, std::int64_t{4});
  EXPECT_NE(error_of(file).find("dim[4] is 0"), std::string::npos);
  put(file, 16, std::int64_t{3});
  put(file, 24, std::int64_t{1} << 40);
  EXPECT_NE(error_of(file).find("dim[1] is 1099511627776"), std::string::npos);
}

TEST(NiftiReader, ErrorsNameTheField) {
  const auto expect = [](std::size_t offset, auto value, const char* part) {
    auto file = small();
    put(file, offset, value);
    EXPECT_NE(error_of(file).find(part), std::string::npos) << error_of(file);
    EXPECT_EQ(error_of(file).find('\n'), std::string::npos);
  };
  expect(0, std::int32_t{540}, "has 412 bytes, a header has 540");
  expect(0, std::int32_t{7}, "sizeof_hdr is 7, must be 348 or 540");
  expect(344, std::int32_t{0}, "magic is not n+1");
  expect(40, std::int16_t{2}, "dim[0] is 2");
  expect(42, std::int16_t{-3}, "dim[1] is -3");
  expect(46, std::int16_t{32767}, "voxels, 60 follow: it is cut off");
  expect(70, std::int16_t{128}, "datatype 128 is not read: save it as one of uint8, int16, int32");
  expect(70, std::int16_t{1280}, "datatype 1280 is not read");
  expect(108, 1e9f, "vox_offset must be");
  expect(112, 2.0f, "scl_slope and scl_inter");
  expect(123, char{5}, "xyzt_units 5");
  expect(280, 2000.0f, "voxels are 2000");
  expect(280, std::numeric_limits<float>::quiet_NaN(), "must be 0.001 to 100");
  expect(296, 1.0f, "its axes are skewed");
  EXPECT_NE(error_of(small(), mesh::Unit::Metre).find("--unit another"), std::string::npos);
  const auto file = small();
  for (std::size_t n = 0; n < file.size(); ++n) EXPECT_FALSE(parse(file.substr(0, n)).ok()) << n;
}

}  // namespace
}  // namespace trocar::label_map
