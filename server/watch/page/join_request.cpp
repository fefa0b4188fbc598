#include "server/watch/page/join_request.h"

#include "common/base/json.h"
#include "common/secure/digest.h"
#include "common/wire/session_messages.h"
#include "proto/wire.pb.h"

namespace trocar::page {
namespace {

constexpr std::size_t kTokenBytes = 16;

std::string text_at(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
}

}  // namespace

wire::EndReason reason_to_wait(const JoinRequest& request, wire::EndReason reason) {
  return request.return_token.empty() ? reason : wire::EndReason::Timeout;
}

std::optional<JoinRefusal> read_join_request(BytesView text, JoinRequest& request) {
  const JoinRefusal no_request{JoinFault::Form, "the page said something else than who joins"};
  if (text.size() > kMostJoinBytes) return no_request;
  const auto json = Json::parse(text.begin(), text.end(), nullptr, false);
  if (!json.is_object()) return no_request;
  request.name = text_at(json, "name");
  request.session = text_at(json, "session");
  const auto role = text_at(json, "role");
  if (role == "instructor")
    request.role = wire::Role::Instructor;
  else if (role == "observer")
    request.role = wire::Role::Observer;
  else
    return JoinRefusal{JoinFault::Form, "a browser joins as instructor or observer"};
  if (const auto token = text_at(json, "token"); !token.empty()) {
    request.return_token = secure::from_hex(token);
    if (request.return_token.size() != kTokenBytes) return no_request;
  }
  const auto code = secure::parse_join_code(text_at(json, "code"));
  if (!code) return JoinRefusal{JoinFault::Code, code.error().message};
  request.code = *code;
  return std::nullopt;
}

wire::SharedBytes hello_of(const JoinRequest& request) {
  return wire::encode_hello({.name = request.name,
                             .role = request.role,
                             .join_secret = request.code.secret,
                             .return_token = request.return_token});
}

}  // namespace trocar::page
