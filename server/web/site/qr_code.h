#pragma once

// A text, such as a link, as a QR code (ISO/IEC 18004) that a phone reads, by libqrencode.

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace trocar::site {

class QrCode {
 public:
  // Nothing: the text is too long for one (2331 bytes), or empty, or holds a zero.
  static std::optional<QrCode> of(std::string_view text);

  // Modules in a row, and in a column.
  int width() const { return width_; }
  bool is_dark(int row, int column) const;
  // The modules row by row: 1 is dark, 0 is light.
  std::string digits() const;
  // Lines for a terminal, two rows in each, black on white with the margin that readers need.
  std::string for_terminal() const;

 private:
  int width_ = 0;
  std::vector<bool> dark_;
};

}  // namespace trocar::site
