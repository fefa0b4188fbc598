#pragma once

// PNG files of 8 bits a channel, red, green and blue.
//
// Source: W3C: Portable Network Graphics, second edition, 2003.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace trocar::picture {

using Colour = std::array<std::uint8_t, 3>;

struct Picture {
  int width = 0, height = 0;
  std::vector<Colour> pixels;  // row by row from the top

  Colour& at(int x, int y) {
    return pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(x)];
  }
};

std::string to_png(const Picture& picture);

}  // namespace trocar::picture
