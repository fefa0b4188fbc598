#include "common/base/printable.h"

namespace trocar {

std::size_t decode_code_point(std::string_view text, std::uint32_t& code_point) {
  const auto lead = static_cast<std::uint8_t>(text.front());
  std::size_t size = 0;
  std::uint32_t smallest = 0;
  if (lead < 0x80) {
    code_point = lead;
    return 1;
  } else if (lead >> 5 == 0x6) {
    size = 2, smallest = 0x80, code_point = lead & 0x1fu;
  } else if (lead >> 4 == 0xe) {
    size = 3, smallest = 0x800, code_point = lead & 0x0fu;
  } else if (lead >> 3 == 0x1e) {
    size = 4, smallest = 0x10000, code_point = lead & 0x07u;
  } else {
    return 0;
  }
  if (text.size() < size) return 0;
  for (std::size_t i = 1; i < size; ++i) {
    const auto byte = static_cast<std::uint8_t>(text[i]);
    if (byte >> 6 != 0x2) return 0;
    code_point = code_point << 6 | (byte & 0x3fu);
  }
  const bool is_surrogate = code_point >= 0xd800 && code_point <= 0xdfff;
  return code_point < smallest || code_point > 0x10ffff || is_surrogate ? 0 : size;
}

bool is_printable(std::uint32_t c) {
  const bool is_control = c < 0x20 || (c >= 0x7f && c < 0xa0);
  const bool is_format = c == 0xad || c == 0x61c || (c >= 0x200b && c <= 0x200f) ||
                         (c >= 0x2028 && c <= 0x202e) || (c >= 0x2060 && c <= 0x206f) ||
                         c == 0xfeff || (c >= 0xfff0 && c <= 0xfffb);
  const bool is_unassigned = (c & 0xfffe) == 0xfffe || (c >= 0xe000 && c <= 0xf8ff) || c >= 0xe0000;
  return !is_control && !is_format && !is_unassigned;
}

bool is_printable(std::string_view text) {
  while (!text.empty()) {
    std::uint32_t code_point = 0;
    const auto size = decode_code_point(text, code_point);
    if (size == 0 || !is_printable(code_point)) return false;
    text.remove_prefix(size);
  }
  return true;
}

std::string printable(std::string_view text, std::size_t limit) {
  std::string shown;
  while (!text.empty()) {
    std::uint32_t code_point = 0;
    const auto size = decode_code_point(text, code_point);
    const bool is_shown = size > 0 && is_printable(code_point);
    if (shown.size() + (is_shown ? size : 1) > limit) break;
    shown += is_shown ? text.substr(0, size) : std::string_view("?");
    text.remove_prefix(size > 0 ? size : 1);
  }
  return shown;
}

std::string as_name(std::string_view text, std::size_t limit) {
  std::string name;
  while (!text.empty()) {
    std::uint32_t code_point = 0;
    const auto size = decode_code_point(text, code_point);
    const auto byte = static_cast<unsigned char>(text.front());
    const std::string latin{static_cast<char>(0xc0 | byte >> 6),
                            static_cast<char>(0x80 | (byte & 0x3f))};
    const auto own = !is_printable(size > 0 ? code_point : byte) ? std::string_view("_")
                     : size > 0                                  ? text.substr(0, size)
                                                                 : std::string_view(latin);
    if (name.size() + own.size() > limit) break;
    name += own;
    text.remove_prefix(size > 0 ? size : 1);
  }
  return name;
}

}  // namespace trocar
