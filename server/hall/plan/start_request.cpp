#include "server/hall/plan/start_request.h"

#include "common/base/json.h"
#include "common/base/printable.h"
#include "server/hall/plan/hall_config.h"

namespace trocar::hall {
namespace {

Error bad_request(const std::string& what) {
  return {ErrorCode::BadMessage, what};
}

}  // namespace

Result<StartRequest> parse_start_request(std::string_view text) {
  if (text.size() > kMostRequestBytes) return bad_request("the request is longer than 4096 bytes");
  const auto json = Json::parse(text, nullptr, false);
  if (!json.is_object())
    return bad_request("the request is no object of JSON, send {\"start\": \"NAME\"}");
  StartRequest request;
  for (const auto& [key, value] : json.items()) {
    std::string* field = key == "start" ? &request.offer : key == "name" ? &request.name : nullptr;
    if (field == nullptr)
      return bad_request("key " + printable(key, 64) + ": is unknown, the keys are start and name");
    if (!value.is_string() || !is_name(value.get<std::string>()))
      return bad_request("key " + key + ": is no name, write 1 to 32 of a to z, 0 to 9 and -");
    *field = value.get<std::string>();
  }
  if (request.offer.empty()) return bad_request("key start: is missing, say what to start");
  return request;
}

}  // namespace trocar::hall
