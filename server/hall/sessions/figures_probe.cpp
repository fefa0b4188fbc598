#include "server/hall/sessions/figures_probe.h"

#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http.hpp>
#include <chrono>

#include "common/base/no_throw.h"

namespace trocar::hall {
namespace {

namespace beast = boost::beast;
namespace http = beast::http;
using tcp = asio::ip::tcp;

constexpr std::chrono::seconds kProbeDeadline{2};
constexpr std::size_t kMostPageBytes = 256 * 1024;
constexpr unsigned kHttpVersion = 11;

}  // namespace

asio::awaitable<std::optional<std::string>> get_page(asio::io_context& context, std::uint16_t port,
                                                     std::string path) {
  beast::tcp_stream stream(context);
  stream.expires_after(kProbeDeadline);
  const tcp::endpoint server(asio::ip::address_v4::loopback(), port);
  const auto [refused] = co_await stream.async_connect(server, kNoThrow);
  if (refused) co_return std::nullopt;
  http::request<http::empty_body> request(http::verb::get, path, kHttpVersion);
  request.set(http::field::host, "127.0.0.1");
  const auto [unsent, sent] = co_await http::async_write(stream, request, kNoThrow);
  if (unsent) co_return std::nullopt;
  beast::flat_buffer buffer(kMostPageBytes);
  http::response_parser<http::string_body> parser;
  parser.body_limit(kMostPageBytes);
  const auto [failed, count] = co_await http::async_read(stream, buffer, parser, kNoThrow);
  if (failed || parser.get().result() != http::status::ok) co_return std::nullopt;
  co_return std::move(parser.get().body());
}

}  // namespace trocar::hall
