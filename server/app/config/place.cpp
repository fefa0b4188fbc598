#include "server/app/config/place.h"

#include <fmt/format.h>

#include <charconv>

namespace trocar::app {

Status parse_place(const char* option, const char* example, const std::string& text,
                   std::string& host, std::uint16_t& port) {
  const Error bad{ErrorCode::Usage,
                  fmt::format("{}: '{}' is not ADDRESS:PORT, such as {}", option, text, example)};
  const auto colon = text.rfind(':');
  if (colon == std::string::npos || colon == 0) return bad;
  std::string address = text.substr(0, colon);
  if (address.starts_with('[') && address.ends_with(']'))
    address = address.substr(1, address.size() - 2);
  std::uint16_t number = 0;
  const char* end = text.data() + text.size();
  const auto parsed = std::from_chars(text.data() + colon + 1, end, number);
  if (address.empty() || parsed.ec != std::errc{} || parsed.ptr != end) return bad;
  host = std::move(address);
  port = number;
  return {};
}

}  // namespace trocar::app
