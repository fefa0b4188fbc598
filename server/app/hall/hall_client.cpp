#include "server/app/hall/hall_client.h"

#include <fmt/format.h>

#include "common/base/printable.h"
#include "server/session/monitoring/http_ask.h"

namespace trocar::app {

Result<Json> HallClient::ask(const std::string& method, const std::string& path,
                             const std::string& body, std::chrono::seconds deadline) const {
  const auto answer = monitoring::ask_and_wait({.host = host_,
                                                .port = port_,
                                                .method = method,
                                                .path = path,
                                                .body = body,
                                                .key = key_,
                                                .deadline = deadline});
  const auto where = fmt::format("{}:{}", host_, port_);
  if (!answer)
    return Error{ErrorCode::ResourceMissing, where + ": no hall answers (" +
                                                 answer.error().message +
                                                 "): start trocar-hall, or give --at HOST:PORT"};
  auto json = Json::parse(answer->body, nullptr, false);
  if (!json.is_object())
    return Error{ErrorCode::BadMessage, where + ": what answers is no hall: give --at HOST:PORT"};
  if (answer->status < 300) return json;
  const auto why = json.find("error");
  return Error{ErrorCode::Refused, why != json.end() && why->is_string()
                                       ? printable(why->get<std::string>())
                                       : fmt::format("the hall says no ({})", answer->status)};
}

}  // namespace trocar::app
