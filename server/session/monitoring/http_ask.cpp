#include "server/session/monitoring/http_ask.h"

#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/this_coro.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http.hpp>
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

struct Exchange {
  boost::system::error_code trouble;
  HttpAnswer answer;
};

// The caller's objects outlive it: it is awaited at once.
asio::awaitable<void> carry(beast::tcp_stream& stream, const HttpQuestion& question,
                            Exchange& exchange) {
  http::request<http::string_body> request(http::string_to_verb(question.method), question.path,
                                           kHttpVersion);
  request.set(http::field::host, question.host);
  request.set(http::field::content_type, "application/json");
  if (!question.key.empty()) request.set(http::field::authorization, "Bearer " + question.key);
  request.body() = question.body;
  request.prepare_payload();
  tcp::resolver resolver(stream.get_executor());
  const auto [unknown, places] =
      co_await resolver.async_resolve(question.host, std::to_string(question.port), kNoThrow);
  if (unknown) co_return void(exchange.trouble = unknown);
  const auto [refused, place] = co_await stream.async_connect(places, kNoThrow);
  if (refused) co_return void(exchange.trouble = refused);
  const auto [unsent, sent] = co_await http::async_write(stream, request, kNoThrow);
  if (unsent) co_return void(exchange.trouble = unsent);
  beast::flat_buffer buffer(kMostAnswerBytes);
  http::response_parser<http::string_body> parser;
  parser.body_limit(kMostAnswerBytes);
  const auto [failed, count] = co_await http::async_read(stream, buffer, parser, kNoThrow);
  if (failed) co_return void(exchange.trouble = failed);
  exchange.answer = {parser.get().result_int(), std::move(parser.get().body())};
}

}  // namespace

asio::awaitable<Result<HttpAnswer>> ask(HttpQuestion question) {
  Exchange exchange;
  beast::tcp_stream stream(co_await asio::this_coro::executor);
  stream.expires_after(question.deadline);
  co_await carry(stream, question, exchange);
  if (exchange.trouble) co_return trouble(exchange.trouble);
  co_return std::move(exchange.answer);
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
