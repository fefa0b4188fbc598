#pragma once

// A picture from the bytes of a PNG or JPEG file, which come from outside: what it may unpack to is
// bounded. Thread: any.

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace trocar::image {

inline constexpr int kMostSide = 2048;  // pixels

using Pixel = std::array<std::uint8_t, 4>;  // red, green, blue, alpha

struct Image {
  int width = 0, height = 0;  // pixels
  std::vector<Pixel> pixels;  // row by row from the top

  const Pixel& at(int x, int y) const {
    return pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(x)];
  }
};

// Error: the file is neither PNG nor JPEG, has more than kMostSide along a side, takes or unpacks
// to more than 64 MiB, or is a JPEG of more than 100 scans, 1,000 tables or 256 codes in a table.
Result<Image> decode(std::string_view file);

}  // namespace trocar::image
