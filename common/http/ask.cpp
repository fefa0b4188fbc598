#include "common/http/ask.h"

#include <fmt/format.h>
#include <openssl/err.h>
#include <openssl/ssl.h>

#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ssl/error.hpp>
#include <boost/asio/this_coro.hpp>
#include <optional>

#include "common/base/no_throw.h"
#include "common/base/spawn.h"

namespace trocar::http {
namespace {

using tcp = asio::ip::tcp;

std::string text_of(const Question& question) {
  const bool is_ipv6 = question.host.find(':') != std::string::npos;
  auto text = fmt::format("{} {} HTTP/1.1\r\nHost: {}:{}\r\nContent-Type: application/json\r\n",
                          question.method, question.path,
                          is_ipv6 ? "[" + question.host + "]" : question.host, question.port);
  if (!question.key.empty()) text += "Authorization: Bearer " + question.key + "\r\n";
  return text + fmt::format("Content-Length: {}\r\n\r\n{}", question.body.size(), question.body);
}

// The caller's objects outlive these three: they are awaited at once.
asio::awaitable<Status> reach(Stream& stream, const tcp::resolver::results_type& places) {
  const auto [refused, place] =
      co_await asio::async_connect(stream.below().socket(), places, kNoThrow);
  if (refused) co_return stream.trouble(refused);
  co_return Status();
}

asio::awaitable<Status> begin_tls(Stream& stream, const Question& question) {
  const auto failed = co_await stream.below().begin_tls(question.host);
  if (failed.category() == asio::error::get_ssl_category() &&
      ERR_GET_REASON(static_cast<unsigned long>(failed.value())) == SSL_R_CERTIFICATE_VERIFY_FAILED)
    co_return Error{ErrorCode::Refused,
                    "nobody whom this machine trusts vouches for its certificate, or that is of "
                    "another host"};
  if (failed) co_return stream.trouble(failed);
  if (!question.certificate_der.empty() &&
      stream.below().peer_certificate_der() != question.certificate_der)
    co_return Error{ErrorCode::Refused, "it shows another certificate than the one expected"};
  co_return Status();
}

asio::awaitable<Result<Answer>> exchange(Stream& stream, const Question& question) {
  const auto text = text_of(question);
  if (const auto sent = co_await stream.write(text); !sent) co_return sent.error();
  const MessageLimits limits{.body_bytes = kMostAnswerBytes};
  Answer answer;
  if (const auto read = co_await stream.read(answer, limits); !read) co_return read.error();
  co_return answer;
}

}  // namespace

// gcc 12 sees the frame's operator new through, and not its operator delete.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wmismatched-new-delete"
asio::awaitable<Result<Answer>> ask(Question question) {
  const auto executor = co_await asio::this_coro::executor;
  tcp::resolver resolver(executor);
  const auto [unknown, places] =
      co_await resolver.async_resolve(question.host, std::to_string(question.port), kNoThrow);
  if (unknown) co_return Error{ErrorCode::ResourceMissing, unknown.message()};
  Stream stream(tcp::socket(executor), question.tls);
  stream.end_after(question.deadline);
  if (const auto reached = co_await reach(stream, places); !reached) co_return reached.error();
  if (question.tls)
    if (const auto begun = co_await begin_tls(stream, question); !begun) co_return begun.error();
  co_return co_await exchange(stream, question);
}
#pragma GCC diagnostic pop

Result<Answer> ask_and_wait(Question question) {
  asio::io_context context;
  std::optional<Result<Answer>> answer;
  const auto work = [&]() -> asio::awaitable<void> {
    answer.emplace(co_await ask(std::move(question)));
  };
  spawn(context.get_executor(), work(), rethrow);
  context.run();
  return std::move(*answer);
}

}  // namespace trocar::http
