#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "client/slicer/big_endian.h"
#include "client/slicer/incoming.h"

namespace trocar::slicer {
namespace {

struct ScalarType {
  int code;
  std::size_t bytes;
};
constexpr ScalarType kScalarTypes[] = {{2, 1}, {3, 1}, {4, 2},  {5, 2},
                                       {6, 4}, {7, 4}, {10, 4}, {11, 8}};
constexpr double kMostLabel = 65535;

struct ImageHeader {
  std::uint16_t version = 0;
  std::uint8_t components = 0, type = 0, endian = 0, coordinates = 0;
  std::array<std::uint16_t, 3> size{}, part_at{}, part{};
  std::array<float, 12> matrix{};

  std::size_t voxels() const { return std::size_t{size[0]} * size[1] * size[2]; }
};

ImageHeader read_image_header(BigEndian& in) {
  ImageHeader image;
  image.version = in.read<std::uint16_t>();
  for (auto* byte : {&image.components, &image.type, &image.endian, &image.coordinates})
    *byte = in.read<std::uint8_t>();
  for (auto& number : image.size) number = in.read<std::uint16_t>();
  for (auto& number : image.matrix) number = in.read<float>();
  for (auto& number : image.part_at) number = in.read<std::uint16_t>();
  for (auto& number : image.part) number = in.read<std::uint16_t>();
  return image;
}

// Returns the bytes of a voxel.
Result<std::size_t> check_image(const Header& header, const ImageHeader& image,
                                std::size_t data_bytes) {
  if (image.components != 1)
    return wrong(header, fmt::format("has {} components, a label map has 1", image.components));
  const auto* type = std::find_if(std::begin(kScalarTypes), std::end(kScalarTypes),
                                  [&](const ScalarType& t) { return t.code == image.type; });
  if (type == std::end(kScalarTypes))
    return wrong(header, fmt::format("scalar_type is {}, known are 2 to 7, 10 and 11", image.type));
  if (image.endian != 1 && image.endian != 2)
    return wrong(header, fmt::format("endian is {}, must be 1 or 2", image.endian));
  if (image.coordinates != 1 && image.coordinates != 2)
    return wrong(header, fmt::format("coord is {}, must be 1 (RAS) or 2 (LPS)", image.coordinates));
  if (*std::min_element(image.size.begin(), image.size.end()) < 2)
    return wrong(header, fmt::format("size is {} x {} x {}, must be 2 or more along each axis",
                                     image.size[0], image.size[1], image.size[2]));
  if (image.voxels() > kMostVoxels)
    return wrong(header, fmt::format("size is {} x {} x {}, allowed are {} voxels: crop it",
                                     image.size[0], image.size[1], image.size[2], kMostVoxels));
  if (image.part != image.size || image.part_at != std::array<std::uint16_t, 3>{})
    return wrong(header, "subvol_size is not size: a label map comes whole");
  if (data_bytes != image.voxels() * type->bytes)
    return wrong(header, fmt::format("has {} bytes of voxels, must be {}", data_bytes,
                                     image.voxels() * type->bytes));
  for (const float number : image.matrix)
    if (!std::isfinite(number)) return wrong(header, "matrix: has a number that is not finite");
  return type->bytes;
}

// Returns that of one voxel.
template <typename T>
double number_at(BytesView data, std::size_t i, bool is_big) {
  std::array<std::uint8_t, sizeof(T)> own{};
  std::copy_n(data.begin() + static_cast<std::ptrdiff_t>(i * sizeof(T)), sizeof(T), own.begin());
  if (is_big) std::reverse(own.begin(), own.end());
  return static_cast<double>(std::bit_cast<T>(own));
}

template <typename T>
Status read_labels(const Header& header, BytesView data, bool is_big,
                   std::vector<std::uint16_t>& labels) {
  for (std::size_t i = 0; i < labels.size(); ++i) {
    const double number = number_at<T>(data, i, is_big);
    if (!(number >= 0 && number <= kMostLabel) || number != std::floor(number))
      return wrong(header, fmt::format("voxel {} is {}, a label is a whole number from 0 to 65535",
                                       i, number));
    labels[i] = static_cast<std::uint16_t>(number);
  }
  return {};
}

Status read_labels_of(const Header& header, int type, BytesView data, bool is_big,
                      std::vector<std::uint16_t>& labels) {
  switch (type) {
    case 2:
      return read_labels<std::int8_t>(header, data, is_big, labels);
    case 3:
      return read_labels<std::uint8_t>(header, data, is_big, labels);
    case 4:
      return read_labels<std::int16_t>(header, data, is_big, labels);
    case 5:
      return read_labels<std::uint16_t>(header, data, is_big, labels);
    case 6:
      return read_labels<std::int32_t>(header, data, is_big, labels);
    case 7:
      return read_labels<std::uint32_t>(header, data, is_big, labels);
    case 10:
      return read_labels<float>(header, data, is_big, labels);
    default:
      return read_labels<double>(header, data, is_big, labels);
  }
}

}  // namespace

Result<LabelImage> read_label_image(const Header& header, BytesView content) {
  BigEndian in(content);
  const auto image = read_image_header(in);
  if (!in.ok())
    return wrong(header,
                 fmt::format("has {} bytes, its header has {}", content.size(), kImageHeaderBytes));
  const auto bytes = check_image(header, image, in.remaining());
  if (!bytes) return bytes.error();
  LabelImage read;
  // LPS runs against the first two axes of RAS.
  const double turn = image.coordinates == 2 ? -1 : 1;
  const auto vector_at = [&](std::size_t i) {
    return Vec3d{turn * double{image.matrix[i]}, turn * double{image.matrix[i + 1]},
                 double{image.matrix[i + 2]}};
  };
  // The message has the centre of the image, and files that of the first voxel.
  read.origin_mm = vector_at(9);
  for (std::size_t k = 0; k < 3; ++k) {
    read.size[k] = image.size[k];
    read.steps_mm[k] = vector_at(3 * k);
    read.origin_mm -= read.steps_mm[k] * (0.5 * (image.size[k] - 1));
  }
  read.labels.resize(image.voxels());
  if (const auto labels =
          read_labels_of(header, image.type, in.rest(), image.endian == 1, read.labels);
      !labels)
    return labels.error();
  if (std::all_of(read.labels.begin(), read.labels.end(), [](auto label) { return label == 0; }))
    return wrong(header, "all voxels are 0: the label map is empty");
  return read;
}

}  // namespace trocar::slicer
