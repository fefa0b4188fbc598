#pragma once

// A NIfTI file of one byte a voxel, as a string that tests change.

#include <array>
#include <cstdint>
#include <cstring>
#include <functional>
#include <string>

namespace trocar::label_map::testing {

template <typename T>
void put(std::string& file, std::size_t offset, T value) {
  std::memcpy(file.data() + offset, &value, sizeof value);
}

// Voxels of `step` mm whose i, j and k run to the right, the front and the head. label(i, j, k).
inline std::string nifti(std::array<int, 3> size, float step,
                         const std::function<int(int, int, int)>& label) {
  std::string file(352, '\0');
  put(file, 0, std::int32_t{348});
  put(file, 40, std::int16_t{3});
  for (std::size_t d = 0; d < 3; ++d) {
    put(file, 42 + 2 * d, static_cast<std::int16_t>(size[d]));
    put(file, 80 + 4 * d, step);
    put(file, 280 + 20 * d, step);  // diagonal of the sform
  }
  put(file, 70, std::int16_t{2});
  put(file, 72, std::int16_t{8});
  put(file, 76, 1.0f);
  put(file, 108, 352.0f);
  put(file, 123, char{2});
  put(file, 254, std::int16_t{1});
  put(file, 292, 10.0f);  // 10 mm to the right
  std::memcpy(file.data() + 344, "n+1", 4);
  for (int k = 0; k < size[2]; ++k)
    for (int j = 0; j < size[1]; ++j)
      for (int i = 0; i < size[0]; ++i) file += static_cast<char>(label(i, j, k));
  return file;
}

}  // namespace trocar::label_map::testing
