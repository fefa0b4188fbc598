#include "server/web/site/qr_code.h"

#include <qrencode.h>

#include <algorithm>
#include <memory>

namespace trocar::site {
namespace {

constexpr int kMargin = 4;  // modules, as the standard wants
constexpr const char *kBegin = "\033[30;107m", *kEnd = "\033[0m\n";
// They show two modules, one above the other: which of them is dark.
constexpr const char *kNone = " ", *kUpper = "\u2580", *kLower = "\u2584", *kBoth = "\u2588";

}  // namespace

std::optional<QrCode> QrCode::of(std::string_view text) {
  if (text.empty() || text.find('\0') != std::string_view::npos) return std::nullopt;
  const std::unique_ptr<QRcode, decltype(&QRcode_free)> made(
      QRcode_encodeString8bit(std::string(text).c_str(), 0, QR_ECLEVEL_M), &QRcode_free);
  if (!made) return std::nullopt;
  QrCode code;
  code.width_ = made->width;
  const auto count = static_cast<std::size_t>(made->width) * static_cast<std::size_t>(made->width);
  for (std::size_t i = 0; i < count; ++i) code.dark_.push_back((made->data[i] & 1) != 0);
  return code;
}

bool QrCode::is_dark(int row, int column) const {
  if (std::min(row, column) < 0 || std::max(row, column) >= width_) return false;
  return dark_[static_cast<std::size_t>(row) * static_cast<std::size_t>(width_) +
               static_cast<std::size_t>(column)];
}

std::string QrCode::digits() const {
  std::string text;
  for (const bool dark : dark_) text += dark ? '1' : '0';
  return text;
}

std::string QrCode::for_terminal() const {
  std::string text;
  for (int row = -kMargin; row < width_ + kMargin; row += 2) {
    text += kBegin;
    for (int column = -kMargin; column < width_ + kMargin; ++column) {
      const bool upper = is_dark(row, column), lower = is_dark(row + 1, column);
      text += upper ? (lower ? kBoth : kUpper) : (lower ? kLower : kNone);
    }
    text += kEnd;
  }
  return text;
}

}  // namespace trocar::site
