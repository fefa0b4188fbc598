#include "client/slicer/scan_files.h"

#include <fmt/format.h>

#include <cstring>
#include <iterator>
#include <string>

#include "common/base/text_file.h"

namespace trocar::slicer {
namespace {

constexpr std::size_t kNiftiHeaderBytes = 348, kNiftiDataAt = 352;
constexpr std::int16_t kUint16 = 512, kScannerPlace = 1;

// Sets a number at a byte of a NIfTI header.
template <typename T>
void set(std::string& file, std::size_t at, T value) {
  std::memcpy(file.data() + at, &value, sizeof value);
}

}  // namespace

Status write_label_map(const std::filesystem::path& path, const LabelImage& image) {
  std::string file(kNiftiDataAt, '\0');
  set(file, 0, static_cast<std::int32_t>(kNiftiHeaderBytes));
  set(file, 40, std::int16_t{3});  // dimensions
  set(file, 70, kUint16);
  set(file, 72, std::int16_t{16});  // bits
  set(file, 76, 1.0f);
  set(file, 108, static_cast<float>(kNiftiDataAt));
  set(file, 123, std::uint8_t{2});  // mm
  set(file, 254, kScannerPlace);    // of the sform; there is no qform
  for (std::size_t k = 0; k < 3; ++k) {
    const auto& step = image.steps_mm[k];
    set(file, 42 + 2 * k, static_cast<std::int16_t>(image.size[k]));
    set(file, 80 + 4 * k, static_cast<float>(length(step)));
    set(file, 280 + 4 * k, static_cast<float>(step.x));
    set(file, 296 + 4 * k, static_cast<float>(step.y));
    set(file, 312 + 4 * k, static_cast<float>(step.z));
  }
  for (std::size_t k = 3; k < 7; ++k) set(file, 42 + 2 * k, std::int16_t{1});
  set(file, 292, static_cast<float>(image.origin_mm.x));
  set(file, 308, static_cast<float>(image.origin_mm.y));
  set(file, 324, static_cast<float>(image.origin_mm.z));
  std::memcpy(file.data() + 344, "n+1", 4);
  const auto bytes = bytes_of(image.labels);
  file.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  return write_text_file(path, file);
}

Status write_surface(const std::filesystem::path& path, const SurfaceMesh& surface) {
  std::string file = "# RAS, mm\n";
  auto end = std::back_inserter(file);
  for (const auto& p : surface.points_mm) fmt::format_to(end, "v {} {} {}\n", p.x, p.y, p.z);
  for (const auto& t : surface.triangles)
    fmt::format_to(end, "f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1);
  return write_text_file(path, file);
}

}  // namespace trocar::slicer
