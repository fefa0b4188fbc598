#include "server/session/monitoring/http_ask.h"

#include <openssl/err.h>
#include <openssl/ssl.h>

#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ssl/error.hpp>
#include <boost/asio/this_coro.hpp>
#include <optional>

#include "common/base/no_throw.h"
#include "common/base/spawn.h"
#include "server/session/monitoring/http_stream.h"

namespace trocar::monitoring {
namespace {

namespace http = boost::beast::http;
using tcp = asio::ip::tcp;

constexpr unsigned kHttpVersion = 11;

Error trouble(const boost::system::error_code& error) {
  return {ErrorCode::ResourceMissing, error.message()};
}

HttpRequest request_of(const HttpQuestion& question) {
  HttpRequest request(http::string_to_verb(question.method), question.path, kHttpVersion);
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
asio::awaitable<Status> reach(HttpStream& stream, const tcp::resolver::results_type& places) {
  const auto [refused, place] =
      co_await asio::async_connect(stream.below().socket(), places, kNoThrow);
  if (refused) co_return trouble(stream.reason(refused));
  co_return Status();
}

asio::awaitable<Status> begin_tls(HttpStream& stream, const HttpQuestion& question) {
  const auto failed = co_await stream.below().begin_tls(question.host);
  if (failed.category() == asio::error::get_ssl_category() &&
      ERR_GET_REASON(static_cast<unsigned long>(failed.value())) == SSL_R_CERTIFICATE_VERIFY_FAILED)
    co_return Error{ErrorCode::Refused,
                    "nobody whom this machine trusts vouches for its certificate, or that is of "
                    "another host"};
  if (failed) co_return trouble(stream.reason(failed));
  if (!question.certificate_der.empty() &&
      stream.below().peer_certificate_der() != question.certificate_der)
    co_return Error{ErrorCode::Refused, "it shows another certificate than the one expected"};
  co_return Status();
}

asio::awaitable<Result<HttpAnswer>> exchange(HttpStream& stream, const HttpQuestion& question) {
  const auto request = request_of(question);
  if (const auto unsent = co_await stream.write(request)) co_return trouble(unsent);
  http::response_parser<http::string_body> parser;
  parser.body_limit(kMostAnswerBytes);
  if (const auto failed = co_await stream.read(parser)) co_return trouble(failed);
  co_return HttpAnswer{parser.get().result_int(), std::move(parser.get().body())};
}

}  // namespace

asio::awaitable<Result<HttpAnswer>> ask(HttpQuestion question) {
  const auto executor = co_await asio::this_coro::executor;
  tcp::resolver resolver(executor);
  const auto [unknown, places] =
      co_await resolver.async_resolve(question.host, std::to_string(question.port), kNoThrow);
  if (unknown) co_return trouble(unknown);
  HttpStream stream(tcp::socket(executor), question.tls);
  stream.end_after(question.deadline);
  if (const auto reached = co_await reach(stream, places); !reached) co_return reached.error();
  if (question.tls)
    if (const auto begun = co_await begin_tls(stream, question); !begun) co_return begun.error();
  co_return co_await exchange(stream, question);
}

Result<HttpAnswer> ask_and_wait(HttpQuestion question) {
  asio::io_context context;
  std::optional<Result<HttpAnswer>> answer;
  const auto work = [&]() -> asio::awaitable<void> {
    answer.emplace(co_await ask(std::move(question)));
  };
  spawn(context.get_executor(), work(), rethrow);
  context.run();
  return std::move(*answer);
}

}  // namespace trocar::monitoring
