#pragma once

// Pictures from the bytes of PNG and JPEG files, which come from outside, and PNG files from
// pictures. What a file may unpack to is bounded. Thread: any.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace trocar::image {

inline constexpr int kMostSide = 2048;  // pixels
inline constexpr std::size_t kMostFileBytes = std::size_t{64} << 20;

using Pixel = std::array<std::uint8_t, 4>;  // red, green, blue, alpha

struct Image {
  int width = 0, height = 0;  // pixels
  std::vector<Pixel> pixels;  // row by row from the top

  const Pixel& at(int x, int y) const {
    return pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(x)];
  }
};

// Error: the file is neither PNG nor JPEG, is larger than kMostFileBytes, has more than kMostSide
// along a side, is damaged or cut short, or is a JPEG in CMYK or of more than 500 scans.
Result<Image> decode(std::string_view file);

// A PNG file of 8 bits a channel. rgb: red, green and blue of each pixel, row by row from the top,
// 3 * width * height bytes; at least one pixel. Error: there is no memory.
Result<std::string> encode_png(int width, int height, std::span<const std::uint8_t> rgb);

}  // namespace trocar::image
