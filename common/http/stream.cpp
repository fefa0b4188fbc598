#include "common/http/stream.h"

#include <fmt/format.h>

#include <boost/asio/buffer.hpp>
#include <boost/beast/core/string.hpp>
#include <boost/beast/http/error.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/rfc7230.hpp>
#include <boost/beast/http/string_body.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <utility>

namespace trocar::http {
namespace {

namespace beast = boost::beast;
using beast::http::error;
using boost::system::error_code;

constexpr std::size_t kPieceBytes = 16 * 1024;

template <typename Parser>
void limit(Parser& parser, const MessageLimits& limits) {
  parser.header_limit(limits.head_bytes);
  parser.body_limit(limits.body_bytes);
  parser.eager(true);
}

Fields fields_of(const beast::http::fields& all) {
  Fields fields;
  for (const auto& field : all) fields.emplace_back(field.name_string(), field.value());
  return fields;
}

bool is_of_http(const error_code& error) {
  return error.category() == beast::http::make_error_code(error::bad_version).category();
}

}  // namespace

std::optional<std::string_view> Request::find(std::string_view name) const {
  for (const auto& [key, value] : fields)
    if (beast::iequals({key.data(), key.size()}, {name.data(), name.size()})) return value;
  return std::nullopt;
}

Stream::Stream(asio::ip::tcp::socket socket, const secure::TlsContext& tls)
    : below_(new Below{secure::Stream(std::move(socket), tls)}),
      timer_(below_->stream.socket().get_executor()) {}

void Stream::end_after(std::chrono::steady_clock::duration span) {
  timer_.expires_after(span);
  timer_.async_wait([held = std::weak_ptr(below_)](const error_code& cancelled) {
    const auto below = held.lock();
    if (cancelled || !below) return;
    below->is_late = true;
    error_code ignored;
    below->stream.socket().close(ignored);
  });
}

void Stream::end_never() {
  timer_.cancel();
}

void Stream::cut() {
  error_code ignored;
  below_->stream.socket().close(ignored);
}

secure::Stream& Stream::below() {
  return below_->stream;
}

std::shared_ptr<secure::Stream> Stream::share_below() {
  return {below_, &below_->stream};
}

Error Stream::trouble(const error_code& error) const {
  return {ErrorCode::ResourceMissing,
          below_->is_late ? error_code(asio::error::timed_out).message() : error.message()};
}

template <typename Parser>
asio::awaitable<error_code> Stream::parse(Parser& parser) {
  std::string piece(kPieceBytes, '\0');
  while (true) {
    error_code parsed = error::need_more;
    while (!unread_.empty() && !parser.is_done()) {
      unread_.erase(0, parser.put(asio::const_buffer(unread_.data(), unread_.size()), parsed));
      if (parsed) break;
    }
    if (parsed && parsed != error::need_more) co_return parsed;
    if (parser.is_done()) co_return error_code();
    const auto [failed, count] = co_await below_->stream.read_some(asio::buffer(piece));
    if (failed == asio::error::eof && parser.got_some()) {
      parsed = {};
      parser.put_eof(parsed);
      co_return parsed;
    }
    if (failed) co_return failed;
    unread_.append(piece, 0, count);
  }
}

asio::awaitable<Reading> Stream::read(Request& request, const MessageLimits& limits) {
  beast::http::request_parser<beast::http::string_body> parser;
  limit(parser, limits);
  const auto failed = co_await parse(parser);
  if (failed && failed != error::body_limit)
    co_return is_of_http(failed) ? Reading::Malformed : Reading::Gone;
  auto& taken = parser.get();
  request = {.method = std::string(taken.method_string()),
             .target = std::string(taken.target()),
             .body = std::move(taken.body()),
             .fields = fields_of(taken),
             .is_old = taken.version() < 11,
             .keeps_alive = taken.keep_alive(),
             .is_for_web_socket = beast::websocket::is_upgrade(taken)};
  co_return failed ? Reading::TooLong : Reading::Whole;
}

asio::awaitable<Status> Stream::read(Answer& answer, const MessageLimits& limits) {
  beast::http::response_parser<beast::http::string_body> parser;
  limit(parser, limits);
  const auto failed = co_await parse(parser);
  if (failed) co_return trouble(failed);
  answer.status = parser.get().result_int();
  answer.body = std::move(parser.get().body());
  co_return Status();
}

asio::awaitable<Status> Stream::write(const std::string& text) {
  const std::vector<asio::const_buffer> buffers{asio::buffer(text)};
  const auto [error, count] = co_await below_->stream.write_all(buffers);
  if (error) co_return trouble(error);
  co_return Status();
}

asio::awaitable<bool> Stream::write(const Request& question, const Answer& answer) {
  const auto status = beast::http::int_to_status(answer.status);
  auto text = fmt::format("HTTP/1.{} {} {}\r\n", question.is_old ? 0 : 1, answer.status,
                          std::string(beast::http::obsolete_reason(status)));
  for (const auto& [name, value] : answer.fields) text += name + ": " + value + "\r\n";
  if (question.keeps_alive == question.is_old)
    text += question.is_old ? "Connection: keep-alive\r\n" : "Connection: close\r\n";
  text += fmt::format("Content-Length: {}\r\n\r\n", answer.length.value_or(answer.body.size()));
  if (question.method != "HEAD") text += answer.body;
  const auto written = co_await write(text);
  co_return written.ok();
}

asio::awaitable<bool> Stream::write(BytesView piece) {
  const std::vector<asio::const_buffer> buffers{asio::buffer(piece.data(), piece.size())};
  const auto [error, count] = co_await below_->stream.write_all(buffers);
  co_return !error;
}

void Stream::shut_down() {
  error_code ignored;
  below_->stream.socket().shutdown(asio::socket_base::shutdown_send, ignored);
}

}  // namespace trocar::http
