#include "server/app/hall/hall_client.h"

#include <fmt/format.h>

#include <ctime>

#include "common/base/printable.h"
#include "common/http/ask.h"
#include "server/app/hall/hall_bus.h"
#include "server/hall/proof/proof.h"

namespace trocar::app {
namespace {

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
  const auto answer = http::ask_and_wait({.host = host_,
                                          .port = port_,
                                          .method = method,
                                          .path = path,
                                          .body = body,
                                          .key = key_,
                                          .deadline = deadline,
                                          .tls = tls_,
                                          .certificate_der = certificate_der_});
  const auto where = fmt::format("{}:{}", host_, port_);
  if (!answer && answer.error().code == ErrorCode::Refused)
    return Error{ErrorCode::Refused, where + ": " + answer.error().message +
                                         ": give --certificate with the hall's own"};
  if (!answer)
    return Error{ErrorCode::ResourceMissing, where + ": no hall answers (" +
                                                 answer.error().message +
                                                 "): start trocar-hall, or give --at HOST:PORT, or "
                                                 "https://HOST:PORT if it has TLS"};
  return read_answer(answer->status, answer->body, where);
}

Result<Json> BusHallClient::ask(const std::string& method, const std::string& path,
                                const std::string& body, std::chrono::seconds deadline) const {
  const auto request =
      hall::write_bus_request(name_, start_, method, path, body, key_, std::time(nullptr));
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
