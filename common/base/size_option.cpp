#include "common/base/size_option.h"

#include <fmt/format.h>

#include <charconv>

namespace trocar {
namespace {

constexpr int kMostWidth = 7680, kMostHeight = 4320;
constexpr std::size_t kMostShown = 60;

}  // namespace

Result<std::pair<int, int>> parse_size(const std::string& text, int least_width, int least_height) {
  int width = 0, height = 0;
  const char* const end = text.data() + text.size();
  const auto first = std::from_chars(text.data(), end, width);
  const bool has_cross = first.ec == std::errc{} && first.ptr != end && *first.ptr == 'x';
  const auto second = std::from_chars(has_cross ? first.ptr + 1 : end, end, height);
  if (has_cross && second.ec == std::errc{} && second.ptr == end && width >= least_width &&
      width <= kMostWidth && height >= least_height && height <= kMostHeight)
    return std::pair{width, height};
  return Error{
      ErrorCode::Usage,
      fmt::format("--size: '{}' is not WxH from {}x{} to {}x{}, such as 1280x720",
                  text.substr(0, kMostShown), least_width, least_height, kMostWidth, kMostHeight)};
}

}  // namespace trocar
