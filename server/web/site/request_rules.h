#pragma once

// Rules about a request that need no network: which part of a file is asked for, whether a page of
// this server opened the connection, and what every answer says for the browser's own safety.

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <utility>

namespace trocar::site {

struct ByteRange {
  std::uint64_t first = 0, length = 0;
};
enum class RangeKind { Whole, Part, Unsatisfiable };
struct AskedRange {
  RangeKind kind = RangeKind::Whole;
  ByteRange range;  // of Part
};
// Reads a Range header of one range ("bytes=0-99", "bytes=100-", "bytes=-50") of a file of `size`
// bytes. Other forms count as none, as RFC 9110 allows.
AskedRange read_range(std::string_view header, std::uint64_t size);

// True if a request's Host names this server: by an address, as localhost, by the machine's name,
// or by the one that links have. A page of another name that was made to lead here is none of it.
bool is_own_host(std::string_view host, std::string_view public_name, std::string_view machine);
// True if `origin` ("https://HOST[:PORT]") names exactly what the request asked for in its Host
// header, by this server's scheme. A page of another site cannot say so.
bool is_own_origin(std::string_view origin, std::string_view host, bool has_tls);

using Header = std::pair<std::string_view, std::string_view>;
// Headers of every answer; with TLS one more.
std::span<const Header> safety_headers(bool has_tls);

}  // namespace trocar::site
