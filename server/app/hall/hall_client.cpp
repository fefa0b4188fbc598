#include "server/app/hall/hall_client.h"

#include "common/base/asio.h"  // before Boost: see there

#include <fmt/format.h>

#include <boost/asio/awaitable.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http.hpp>
#include <ctime>

#include "common/base/no_throw.h"
#include "common/base/printable.h"
#include "server/app/hall/hall_bus.h"
#include "server/hall/bus/proof.h"

namespace trocar::app {
namespace {

namespace beast = boost::beast;
namespace http = beast::http;
using tcp = asio::ip::tcp;

constexpr std::size_t kMostAnswerBytes = 1u << 20;
constexpr unsigned kHttpVersion = 11;

struct RawAnswer {
  std::string trouble;  // of the way there; empty: none
  unsigned status = 0;
  std::string body;
};

asio::awaitable<void> exchange(beast::tcp_stream& stream, const std::string& host,
                               std::uint16_t port, const http::request<http::string_body>& request,
                               RawAnswer& answer) {
  tcp::resolver resolver(stream.get_executor());
  const auto [unknown, places] =
      co_await resolver.async_resolve(host, std::to_string(port), kNoThrow);
  if (unknown) co_return void(answer.trouble = unknown.message());
  const auto [refused, place] = co_await stream.async_connect(places, kNoThrow);
  if (refused) co_return void(answer.trouble = refused.message());
  const auto [unsent, sent] = co_await http::async_write(stream, request, kNoThrow);
  if (unsent) co_return void(answer.trouble = unsent.message());
  beast::flat_buffer buffer(kMostAnswerBytes);
  http::response_parser<http::string_body> parser;
  parser.body_limit(kMostAnswerBytes);
  const auto [failed, count] = co_await http::async_read(stream, buffer, parser, kNoThrow);
  if (failed) co_return void(answer.trouble = failed.message());
  answer.status = parser.get().result_int();
  answer.body = std::move(parser.get().body());
}

Result<Json> read_answer(unsigned status, const std::string& body, const std::string& where) {
  auto json = Json::parse(body, nullptr, false);
  if (!json.is_object())
    return Error{ErrorCode::BadMessage, where + ": what answers is no hall: give --at HOST:PORT"};
  if (status < 300) return json;
  const auto why = json.find("error");
  return Error{ErrorCode::Refused, why != json.end() && why->is_string()
                                       ? printable(why->get<std::string>())
                                       : fmt::format("the hall says no ({})", status)};
}

}  // namespace

Result<Json> HallClient::ask(const std::string& method, const std::string& path,
                             const std::string& body, std::chrono::seconds deadline) const {
  http::request<http::string_body> request(http::string_to_verb(method), path, kHttpVersion);
  request.set(http::field::host, host_);
  request.set(http::field::content_type, "application/json");
  if (!key_.empty()) request.set(http::field::authorization, "Bearer " + key_);
  request.body() = body;
  request.prepare_payload();
  asio::io_context context;
  beast::tcp_stream stream(context);
  stream.expires_after(deadline);
  RawAnswer answer;
  asio::co_spawn(context, exchange(stream, host_, port_, request, answer), rethrow);
  context.run();
  const auto where = fmt::format("{}:{}", host_, port_);
  if (!answer.trouble.empty())
    return Error{ErrorCode::ResourceMissing, where + ": no hall answers (" + answer.trouble +
                                                 "): start trocar-hall, or give --at HOST:PORT"};
  return read_answer(answer.status, answer.body, where);
}

Result<Json> BusHallClient::ask(const std::string& method, const std::string& path,
                                const std::string& body, std::chrono::seconds deadline) const {
  const auto request = hall::write_bus_request(name_, method, path, body, key_, std::time(nullptr));
  const auto text = bus_.ask(request_subject(name_), request, deadline);
  if (!text) return text.error();
  const auto answer = Json::parse(*text, nullptr, false);
  const bool is_answer = answer.is_object() && answer.contains("status") &&
                         answer["status"].is_number_unsigned() && answer.contains("body") &&
                         answer["body"].is_string();
  if (!is_answer) return Error{ErrorCode::BadMessage, name_ + ": what answers is no hall"};
  return read_answer(answer["status"].get<unsigned>(), answer["body"].get<std::string>(), name_);
}

}  // namespace trocar::app
