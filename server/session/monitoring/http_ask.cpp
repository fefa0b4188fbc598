#include "server/session/monitoring/http_ask.h"

#include <openssl/ssl.h>

#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/address.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ssl/host_name_verification.hpp>
#include <boost/asio/this_coro.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/ssl/ssl_stream.hpp>
#include <optional>

#include "common/base/no_throw.h"

namespace trocar::monitoring {
namespace {

namespace beast = boost::beast;
namespace http = beast::http;
using tcp = asio::ip::tcp;

constexpr unsigned kHttpVersion = 11;

Error trouble(const boost::system::error_code& error) {
  return {ErrorCode::ResourceMissing, error.message()};
}

http::request<http::string_body> request_of(const HttpQuestion& question) {
  http::request<http::string_body> request(http::string_to_verb(question.method), question.path,
                                           kHttpVersion);
  const bool is_ipv6 = question.host.find(':') != std::string::npos;
  request.set(http::field::host, (is_ipv6 ? "[" + question.host + "]" : question.host) + ":" +
                                     std::to_string(question.port));
  request.set(http::field::content_type, "application/json");
  if (!question.key.empty()) request.set(http::field::authorization, "Bearer " + question.key);
  request.body() = question.body;
  request.prepare_payload();
  return request;
}

// The caller's objects outlive these three: they are awaited at once.
asio::awaitable<Status> reach(beast::tcp_stream& stream, const HttpQuestion& question) {
  tcp::resolver resolver(stream.get_executor());
  const auto [unknown, places] =
      co_await resolver.async_resolve(question.host, std::to_string(question.port), kNoThrow);
  if (unknown) co_return trouble(unknown);
  const auto [refused, place] = co_await stream.async_connect(places, kNoThrow);
  if (refused) co_return trouble(refused);
  co_return Status();
}

asio::awaitable<Status> begin_tls(beast::ssl_stream<beast::tcp_stream>& stream,
                                  const HttpQuestion& question) {
  const bool is_pinned = !question.certificate_der.empty();
  boost::system::error_code unset;
  if (!is_pinned)
    stream.set_verify_callback(asio::ssl::host_name_verification(question.host), unset);
  if (unset) co_return trouble(unset);
  asio::ip::make_address(question.host, unset);
  const bool is_name = unset.failed();  // no address may be a server's name (RFC 6066, 3)
  if (is_name && SSL_set_tlsext_host_name(stream.native_handle(), question.host.c_str()) != 1)
    co_return Error{ErrorCode::ResourceMissing, "the host's name is too long"};
  const auto [failed] = co_await stream.async_handshake(asio::ssl::stream_base::client, kNoThrow);
  if (failed && !is_pinned && SSL_get_verify_result(stream.native_handle()) != X509_V_OK)
    co_return Error{ErrorCode::Refused,
                    "nobody whom this machine trusts vouches for its certificate, or that is of "
                    "another host"};
  if (failed) co_return trouble(failed);
  if (is_pinned && secure::peer_certificate_der(stream.native_handle()) != question.certificate_der)
    co_return Error{ErrorCode::Refused, "it shows another certificate than the one expected"};
  co_return Status();
}

template <typename Stream>
asio::awaitable<Result<HttpAnswer>> exchange(Stream& stream, const HttpQuestion& question) {
  const auto request = request_of(question);
  const auto [unsent, sent] = co_await http::async_write(stream, request, kNoThrow);
  if (unsent) co_return trouble(unsent);
  beast::flat_buffer buffer(kMostAnswerBytes);
  http::response_parser<http::string_body> parser;
  parser.body_limit(kMostAnswerBytes);
  const auto [failed, count] = co_await http::async_read(stream, buffer, parser, kNoThrow);
  if (failed) co_return trouble(failed);
  co_return HttpAnswer{parser.get().result_int(), std::move(parser.get().body())};
}

}  // namespace

asio::awaitable<Result<HttpAnswer>> ask(HttpQuestion question) {
  beast::tcp_stream plain(co_await asio::this_coro::executor);
  plain.expires_after(question.deadline);
  if (const auto reached = co_await reach(plain, question); !reached) co_return reached.error();
  if (!question.tls) co_return co_await exchange(plain, question);
  beast::ssl_stream<beast::tcp_stream> sealed(std::move(plain), *question.tls);
  if (const auto begun = co_await begin_tls(sealed, question); !begun) co_return begun.error();
  co_return co_await exchange(sealed, question);
}

Result<HttpAnswer> ask_and_wait(HttpQuestion question) {
  asio::io_context context;
  std::optional<Result<HttpAnswer>> answer;
  asio::co_spawn(
      context,
      [&]() -> asio::awaitable<void> { answer.emplace(co_await ask(std::move(question))); },
      rethrow);
  context.run();
  return std::move(*answer);
}

}  // namespace trocar::monitoring
