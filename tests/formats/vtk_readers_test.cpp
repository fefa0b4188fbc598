#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <string>

#include "common/base/bytes.h"
#include "server/organs/formats/vtk_reader.h"
#include "server/organs/formats/vtu_reader.h"
#include "tests/formats/reader_samples.h"

namespace trocar::formats {
namespace {

using testing::changed;
using testing::error_of;
using testing::kVtk;
using testing::kVtk51;
using testing::kVtu;

mesh::RawTets tets_in(std::string_view text, const std::string& name) {
  auto parsed = parse_mesh(text, name);
  EXPECT_TRUE(parsed.ok()) << parsed.error().message;
  return parsed.ok() ? std::get<mesh::RawTets>(std::move(*parsed)) : mesh::RawTets{};
}

void expect_the_tet(const mesh::RawTets& raw) {
  ASSERT_EQ(raw.positions.size(), 4u);
  EXPECT_EQ(raw.positions[3], (Vec3d{0, 0, 1}));
  ASSERT_EQ(raw.tets.size(), 1u);
  EXPECT_EQ(raw.tets[0], (mesh::Tet{NodeIndex(0), NodeIndex(1), NodeIndex(2), NodeIndex(3)}));
}

template <typename T>
void put_big_endian(std::string& out, T value) {
  std::string bytes(reinterpret_cast<const char*>(&value), sizeof value);
  out.append(bytes.rbegin(), bytes.rend());
}

TEST(VtkReader, ReadsTextOfBothLayouts) {
  const auto raw = tets_in(kVtk, "a.vtk");
  expect_the_tet(raw);
  EXPECT_EQ(raw.tet_regions, std::vector<std::int64_t>{7});
  expect_the_tet(tets_in(kVtk51, "a.vtk"));
}

TEST(VtkReader, ReadsBinaryAndNoPartOfIt) {
  std::string text =
      "# vtk DataFile Version 3.0\n\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n";
  for (const float c : {0.f, 0.f, 0.f, 1.f, 0.f, 0.f, 0.f, 1.f, 0.f, 0.f, 0.f, 1.f})
    put_big_endian(text, c);
  text += "\nCELLS 1 5\n";
  for (const std::int32_t i : {4, 0, 1, 2, 3}) put_big_endian(text, i);
  text += "\nCELL_TYPES 1\n";
  put_big_endian(text, std::int32_t{10});
  expect_the_tet(tets_in(text, "a.vtk"));
  for (std::size_t n = 0; n < text.size(); ++n)
    EXPECT_FALSE(parse_mesh(std::string_view(text).substr(0, n), "a.vtk").ok()) << n;
}

// VTK writes each of these kinds.
TEST(VtkReader, DataOfEachKindAreReadOverAndSaid) {
  const auto raw = tets_in(
      kVtk +
          "COLOR_SCALARS paint 3\n0 0 0 0 0 0 0 0 0 0 0 0\nLOOKUP_TABLE hues 2\n0 0 0 1 1 1 1 1\n"
          "TEXTURE_COORDINATES uv 2 float\n0 0 1 0 1 1 0 1\nGLOBAL_IDS ids vtkIdType\n0 1 2 3\n"
          "TENSORS6 s float\n1 2 3 4 5 6 1 2 3 4 5 6 1 2 3 4 5 6 1 2 3 4 5 6\n"
          "FIELD more 2\nnames 1 4 string\na b\n\nc\nd\nflags 1 4 bit\n0 1 1 0\n",
      "a.vtk");
  expect_the_tet(raw);
  EXPECT_EQ(raw.left_out.back(),
            "left out: cell data 'other', point data 'u', point data 'paint', point data 'hues', "
            "point data 'uv', point data 'ids', point data 's', point data 'names', point data "
            "'flags'");
}

TEST(VtkReader, RegionsComeBehindBinaryDataOfNoFixedSize) {
  std::string text = changed(kVtk51, "ASCII", "BINARY");
  text.resize(text.find("0 0 0 1 0 0"));
  for (const float c : {0.f, 0.f, 0.f, 1.f, 0.f, 0.f, 0.f, 1.f, 0.f, 0.f, 0.f, 1.f})
    put_big_endian(text, c);
  text += "\nCELLS 2 4\nOFFSETS vtktypeint64\n";
  for (const std::int64_t i : {0, 4}) put_big_endian(text, i);
  text += "\nCONNECTIVITY vtktypeuint8\n" + std::string("\0\1\2\3", 4) + "\nCELL_TYPES 1\n";
  put_big_endian(text, std::int32_t{10});
  // A length below 64 has one byte, one below 16,384 two.
  text += "\nCELL_DATA 1\nFIELD f 4\nshort 1 1 string\n\xc5liver\nlong 1 1 string\n\x80\x46" +
          std::string(70, 'x') + "\nflags 3 1 bit\n\xa0\nregion 1 1 vtktypeuint8\n\xc8\n";
  const auto raw = tets_in(text, "a.vtk");
  expect_the_tet(raw);
  EXPECT_EQ(raw.tet_regions, std::vector<std::int64_t>{200});
  for (std::size_t n = text.find("short"); n + 1 < text.size(); ++n)
    EXPECT_FALSE(parse_mesh(std::string_view(text).substr(0, n), "a.vtk").ok()) << n;
}

TEST(VtkReader, ErrorsSayWhereAndWhat) {
  const auto expect = [](const std::string& text, const char* part) {
    ASSERT_FALSE(text.empty()) << part;
    EXPECT_NE(error_of(text, "a.vtk").find(part), std::string::npos) << error_of(text, "a.vtk");
  };
  expect("x", "does not begin with '# vtk DataFile Version'");
  expect(changed(kVtk, "ASCII", "asc"), "a.vtk:3: expected ASCII or BINARY");
  expect(changed(kVtk, "UNSTRUCTURED_GRID", "STRUCTURED_POINTS"), "is a 'STRUCTURED_POINTS'");
  expect(changed(kVtk, "0 1 0\n", "0 x 0\n"), "node 2: coordinate 'x' is not a finite number");
  expect(changed(kVtk, "4 0 1 2 3", "4 0 1 2 9"), "cell 0 refers to node 9, the file has 4");
  expect(changed(kVtk, "4 0 1 2 3", "4 0 1 2 2"), "cell 0 uses node 2 twice");
  expect(changed(kVtk, "4 0 1 2 3", "-4 0 1 2 3"), "cell 0 has -4 nodes");
  expect(changed(kVtk, "10\n5", "12\n5"), "cell 0 has type 12 (hexahedron)");
  expect(changed(kVtk, "CELL_TYPES 2", "CELL_TYPES 1"), "has 1 cell types for 2 cells");
  expect(changed(kVtk, "CELL_DATA 2", "CELL_DATA 3"), "has 3 data for 2 cells");
  expect(changed(kVtk, "SCALARS", "COLOURS"), "data of kind 'COLOURS' cannot be read");
  expect(changed(kVtk51, "0 4\n", "0 5\n"), "offset 1 is 5, must ascend from 0 to 4");
  expect(changed(kVtk51, "vtktypeint64", "float"), "numbers of type 'float'");
}

TEST(VtuReader, ReadsText) {
  const auto raw = tets_in(kVtu, "a.vtu");
  expect_the_tet(raw);
  EXPECT_EQ(raw.tet_regions, std::vector<std::int64_t>{7});
}

std::string base64(std::string_view bytes) {
  static constexpr char kDigits[] =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t bits = 0;
    for (std::size_t k = 0; k < 3; ++k)
      bits = bits << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k)
      out += i + k > bytes.size() ? '=' : kDigits[bits >> (18 - 6 * k) & 63];
  }
  return out;
}

template <typename T>
std::string bytes_from(std::initializer_list<T> values) {
  std::string out;
  for (const T value : values) out.append(reinterpret_cast<const char*>(&value), sizeof value);
  return out;
}

const std::string kCoordinates = bytes_from<double>({0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1});

// The coordinates as `format` and `content`; other arrays stay text.
std::string with_points(const std::string& content, const std::string& format,
                        const std::string& file_attributes) {
  auto text = changed(kVtu, "0 0 0 1 0 0 0 1 0 0 0 1", content);
  text = changed(text, "NumberOfComponents=\"3\" format=\"ascii\"",
                 "NumberOfComponents=\"3\" format=" + format);
  return changed(text, "byte_order=\"LittleEndian\"",
                 "byte_order=\"LittleEndian\" " + file_attributes);
}

TEST(VtuReader, ReadsBase64PackedOrNot) {
  const auto size = static_cast<std::uint32_t>(kCoordinates.size());
  // The length and the numbers are encoded together or apart, both are seen.
  const std::string together = base64(bytes_from({size}) + kCoordinates),
                    apart = base64(bytes_from({size})) + base64(kCoordinates);
  for (const auto& content : {together, apart})
    expect_the_tet(tets_in(with_points(content, "\"binary\"", ""), "a.vtu"));

  uLongf packed_size = compressBound(size);
  std::string packed(packed_size, '\0');
  ASSERT_EQ(compress(reinterpret_cast<Bytef*>(packed.data()), &packed_size,
                     reinterpret_cast<const Bytef*>(kCoordinates.data()), size),
            Z_OK);
  packed.resize(packed_size);
  const std::string header = bytes_from<std::uint64_t>({1, 4096, size, packed_size});
  const std::string attributes = "header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\"";
  expect_the_tet(
      tets_in(with_points(base64(header) + base64(packed), "\"binary\"", attributes), "a.vtu"));
  const auto damaged = with_points(base64(header) + base64(packed.substr(0, packed.size() - 3)),
                                   "\"binary\"", attributes);
  EXPECT_NE(error_of(damaged, "a.vtu").find("points: a packed block is cut off"), std::string::npos)
      << error_of(damaged, "a.vtu");
}

TEST(VtuReader, ReadsBothByteOrders) {
  for (const bool is_wide : {false, true}) {
    std::string bytes;
    if (is_wide)
      put_big_endian(bytes, std::uint64_t{kCoordinates.size()});
    else
      put_big_endian(bytes, static_cast<std::uint32_t>(kCoordinates.size()));
    for (const double c : {0., 0., 0., 1., 0., 0., 0., 1., 0., 0., 0., 1.})
      put_big_endian(bytes, c);
    const auto text =
        with_points(base64(bytes), "\"binary\"", is_wide ? "header_type=\"UInt64\"" : "");
    expect_the_tet(tets_in(changed(text, "LittleEndian", "BigEndian"), "a.vtu"));
  }
}

TEST(VtuReader, ArraysOfTextsAreLeftOutAndSaid) {
  const auto raw = tets_in(changed(kVtu, "<PointData>",
                                   "<FieldData><Array type=\"String\" Name=\"who\" "
                                   "format=\"ascii\">65 0</Array></FieldData><PointData>"),
                           "a.vtu");
  EXPECT_EQ(raw.left_out, std::vector<std::string>{"left out: field data 'who', point data 'u'"});
}

TEST(VtuReader, PiecesAreOneMesh) {
  const auto begin = kVtu.find("<Piece"), end = kVtu.find("</UnstructuredGrid>");
  const auto second = changed(kVtu.substr(begin, end - begin), ">7<", ">8<");
  const std::string none = "<Piece NumberOfPoints=\"0\" NumberOfCells=\"0\"></Piece>\n";
  const auto raw =
      tets_in(changed(kVtu, "</UnstructuredGrid>",
                      none + changed(second, "0 0 0 1 0 0", "0 0 5 1 0 0") + "</UnstructuredGrid>"),
              "a.vtu");
  ASSERT_EQ(raw.tets.size(), 2u);
  EXPECT_EQ(raw.positions[4], (Vec3d{0, 0, 5}));
  EXPECT_EQ(raw.tets[1], (mesh::Tet{NodeIndex(4), NodeIndex(5), NodeIndex(6), NodeIndex(7)}));
  EXPECT_EQ(raw.tet_regions, (std::vector<std::int64_t>{7, 8}));
  EXPECT_EQ(raw.left_out, std::vector<std::string>{"left out: point data 'u'"});
}

TEST(VtuReader, ReadsAppendedData) {
  const auto size = static_cast<std::uint32_t>(kCoordinates.size());
  const std::string framed = bytes_from({size}) + kCoordinates;
  for (const bool is_raw : {true, false}) {
    auto text = with_points("", "\"appended\" offset=\"0\"", "");
    text =
        changed(text, "</VTKFile>",
                std::string("<AppendedData encoding=\"") + (is_raw ? "raw" : "base64") + "\">\n_" +
                    (is_raw ? framed : base64(framed)) + "\n</AppendedData></VTKFile>");
    expect_the_tet(tets_in(text, "a.vtu"));
  }
}

TEST(VtuReader, ErrorsSayWhat) {
  const auto expect = [](const std::string& text, const char* part) {
    ASSERT_FALSE(text.empty()) << part;
    EXPECT_NE(error_of(text, "a.vtu").find(part), std::string::npos) << error_of(text, "a.vtu");
  };
  expect("<a>", "does not begin with a VTKFile element");
  expect(changed(kVtu, "UnstructuredGrid", "PolyData"), "is of type 'PolyData'");
  expect(changed(kVtu, "LittleEndian", "Middle"), "byte_order must be LittleEndian or BigEndian");
  expect(changed(kVtu, "NumberOfPoints=\"4\"", "NumberOfPoints=\"4000000000\""),
         "12 numbers, the piece announces 4000000000 points");
  expect(changed(kVtu, "NumberOfCells=\"1\"", "NumberOfCells=\"2\""), "the piece announces 2");
  expect(changed(kVtu, ">4<", ">5<"), "offsets: 5 behind 0");
  expect(changed(kVtu, ">10<", ">12<"), "cell 0 has type 12");
  expect(changed(kVtu, "1 0 0 0 1", "1 0 nan 0 1"), "points: number 'nan' cannot be read");
  expect(kVtu.substr(0, 100), "is cut off");
  // Lengths that nothing stands behind take no memory.
  const std::string huge = base64(bytes_from<std::uint32_t>({0xffffffff}));
  expect(with_points(huge, "\"binary\"", ""), "data announce 4294967295 bytes, 0 follow");
  expect(with_points(base64(bytes_from<std::uint32_t>({0xffffffff, 1, 1})), "\"binary\"",
                     "compressor=\"vtkZLibDataCompressor\""),
         "blocks, there is no room");
  expect(with_points("AA=B", "\"binary\"", ""), "which is not base64");
}

}  // namespace
}  // namespace trocar::formats
