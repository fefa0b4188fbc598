#include "server/session/monitoring/http_stream.h"

#include <boost/asio/buffer.hpp>
#include <boost/beast/http/error.hpp>
#include <utility>

namespace trocar::monitoring {
namespace {

namespace http = boost::beast::http;
using boost::system::error_code;

constexpr std::size_t kPieceBytes = 16 * 1024;

std::string version_text(unsigned version) {
  return "HTTP/" + std::to_string(version / 10) + "." + std::to_string(version % 10);
}

template <typename Message>
std::string with_fields(std::string first_line, const Message& message) {
  std::string text = std::move(first_line) + "\r\n";
  for (const auto& field : message)
    text += std::string(field.name_string()) + ": " + std::string(field.value()) + "\r\n";
  return text + "\r\n" + message.body();
}

}  // namespace

HttpStream::HttpStream(asio::ip::tcp::socket socket, const secure::TlsContext& tls)
    : below_(new Below{secure::Stream(std::move(socket), tls)}),
      timer_(below_->stream.socket().get_executor()) {}

void HttpStream::end_after(std::chrono::steady_clock::duration span) {
  timer_.expires_after(span);
  timer_.async_wait([held = std::weak_ptr(below_)](const error_code& cancelled) {
    const auto below = held.lock();
    if (cancelled || !below) return;
    below->is_late = true;
    error_code ignored;
    below->stream.socket().close(ignored);
  });
}

void HttpStream::end_never() {
  timer_.cancel();
}

secure::Stream& HttpStream::below() {
  return below_->stream;
}

error_code HttpStream::reason(const error_code& error) const {
  return error && below_->is_late ? error_code(asio::error::timed_out) : error;
}

template <bool is_request>
asio::awaitable<error_code> HttpStream::read(http::basic_parser<is_request>& parser,
                                             bool header_only) {
  parser.eager(!header_only);
  std::string piece(kPieceBytes, '\0');
  while (true) {
    error_code error = http::error::need_more;
    while (!unread_.empty()) {
      unread_.erase(0, parser.put(asio::const_buffer(unread_.data(), unread_.size()), error));
      if (error || parser.is_done() || (header_only && parser.is_header_done())) break;
    }
    if (error && error != http::error::need_more) co_return error;
    if (parser.is_done() || (header_only && parser.is_header_done())) co_return error_code();
    const auto [failed, count] = co_await below_->stream.read_some(asio::buffer(piece));
    if (failed == asio::error::eof && parser.got_some()) {
      error = {};
      parser.put_eof(error);
      co_return error;
    }
    if (failed == asio::error::eof) co_return http::error::end_of_stream;
    if (failed) co_return reason(failed);
    unread_.append(piece, 0, count);
  }
}
template asio::awaitable<error_code> HttpStream::read(http::basic_parser<true>&, bool);
template asio::awaitable<error_code> HttpStream::read(http::basic_parser<false>&, bool);

asio::awaitable<error_code> HttpStream::write_text(const std::string& text) {
  const std::vector<asio::const_buffer> buffers{asio::buffer(text)};
  const auto [error, count] = co_await below_->stream.write_all(buffers);
  co_return reason(error);
}

asio::awaitable<error_code> HttpStream::write(const HttpRequest& request) {
  const auto text =
      with_fields(std::string(request.method_string()) + " " + std::string(request.target()) + " " +
                      version_text(request.version()),
                  request);
  co_return co_await write_text(text);
}

asio::awaitable<error_code> HttpStream::write(const HttpResponse& response) {
  const auto text =
      with_fields(version_text(response.version()) + " " + std::to_string(response.result_int()) +
                      " " + std::string(response.reason()),
                  response);
  co_return co_await write_text(text);
}

void HttpStream::shut_down() {
  error_code ignored;
  below_->stream.socket().shutdown(asio::socket_base::shutdown_send, ignored);
}

}  // namespace trocar::monitoring
