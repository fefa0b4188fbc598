#include "server/web/site/request_rules.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <string>

namespace trocar::site {
namespace {

// The last one is for TLS alone.
constexpr std::array<Header, 9> kSafetyHeaders{
    {{"Content-Security-Policy",
      "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self'; connect-src "
      "'self'; img-src 'self' data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors "
      "'none'"},
     {"X-Content-Type-Options", "nosniff"},
     {"X-Frame-Options", "DENY"},
     {"Referrer-Policy", "no-referrer"},
     {"Cross-Origin-Opener-Policy", "same-origin"},
     {"Cross-Origin-Embedder-Policy", "require-corp"},
     {"Cross-Origin-Resource-Policy", "same-origin"},
     {"Permissions-Policy", "camera=(), geolocation=(), microphone=(), payment=(), usb=()"},
     {"Strict-Transport-Security", "max-age=31536000"}}};

std::optional<std::uint64_t> read_number(std::string_view text) {
  std::uint64_t number = 0;
  const auto* end = text.data() + text.size();
  const auto parsed = std::from_chars(text.data(), end, number);
  if (text.empty() || parsed.ec != std::errc{} || parsed.ptr != end) return std::nullopt;
  return number;
}

char lower(char c) {
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

}  // namespace

AskedRange read_range(std::string_view header, std::uint64_t size) {
  constexpr std::string_view kUnit = "bytes=";
  if (!header.starts_with(kUnit)) return {};
  header.remove_prefix(kUnit.size());
  const auto dash = header.find('-');
  if (dash == std::string_view::npos || header.find(',') != std::string_view::npos) return {};
  const auto from = read_number(header.substr(0, dash)), to = read_number(header.substr(dash + 1));
  if (dash == 0) {  // the last bytes
    if (!to) return {};
    const auto length = std::min(*to, size);
    if (length == 0) return {.kind = RangeKind::Unsatisfiable, .range = {}};
    return {.kind = RangeKind::Part, .range = {size - length, length}};
  }
  const bool has_end = dash + 1 < header.size();
  if (!from || (has_end && !to) || (to && *to < *from)) return {};
  if (*from >= size) return {.kind = RangeKind::Unsatisfiable, .range = {}};
  const auto last = std::min(to.value_or(size - 1), size - 1);
  return {.kind = RangeKind::Part, .range = {*from, last - *from + 1}};
}

bool is_own_host(std::string_view host, std::string_view public_name, std::string_view machine) {
  const auto without_port = [](std::string_view name) {
    const bool is_v6 = name.starts_with('[');
    return name.substr(0, is_v6 ? name.find(']') + 1 : name.find(':'));
  };
  const auto name = without_port(host);
  if (name.starts_with('[')) return true;
  if (!name.empty() && name.find_first_not_of("0123456789.") == std::string_view::npos) return true;
  const auto is = [&](std::string_view known) {
    return !known.empty() && std::ranges::equal(name, known, {}, lower, lower);
  };
  return is("localhost") || is(without_port(public_name)) || is(machine) ||
         is(std::string(machine) + ".local");
}

bool is_own_origin(std::string_view origin, std::string_view host, bool has_tls) {
  const std::string own = (has_tls ? "https://" : "http://") + std::string(host);
  return !host.empty() && std::ranges::equal(origin, own, {}, lower, lower);
}

std::span<const Header> safety_headers(bool has_tls) {
  return std::span(kSafetyHeaders).first(kSafetyHeaders.size() - (has_tls ? 0 : 1));
}

}  // namespace trocar::site
