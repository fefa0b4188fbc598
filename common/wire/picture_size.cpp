#include "common/wire/picture_size.h"

namespace trocar::wire {
namespace {

// The bytes at a place, most significant first; 0 beyond the end.
std::size_t number_at(std::string_view file, std::size_t at, std::size_t bytes) {
  std::size_t number = 0;
  for (std::size_t i = at; i < at + bytes; ++i)
    number = number << 8 | (i < file.size() ? static_cast<unsigned char>(file[i]) : 0u);
  return number;
}

// A segment that tells the frame's size: SOF0 to SOF15, among which 4, 8 and 12 are others.
bool is_frame(std::size_t marker) {
  return marker == 0xc0 || (marker > 0xc0 && marker <= 0xcf && marker % 4 != 0);
}

}  // namespace

std::optional<std::array<std::size_t, 2>> picture_size(std::string_view file) {
  if (file.starts_with("\x89PNG\r\n\x1a\n")) {
    if (file.size() < 24 || file.substr(12, 4) != "IHDR") return std::nullopt;
    return {{number_at(file, 16, 4), number_at(file, 20, 4)}};
  }
  if (!file.starts_with("\xff\xd8")) return std::nullopt;
  std::size_t at = 2;
  while (at + 9 <= file.size() && number_at(file, at, 1) == 0xff) {
    const std::size_t marker = number_at(file, at + 1, 1);
    if (marker == 0xff) {  // fills up
      ++at;
      continue;
    }
    if (is_frame(marker)) return {{number_at(file, at + 7, 2), number_at(file, at + 5, 2)}};
    if (marker == 0xda || marker == 0xd9) break;  // the scan, or the end
    at += 2 + number_at(file, at + 2, 2);
  }
  return std::nullopt;
}

}  // namespace trocar::wire
