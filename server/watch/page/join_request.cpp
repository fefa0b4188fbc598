#include "server/watch/page/join_request.h"

#include "common/base/json.h"
#include "common/secure/digest.h"
#include "common/tool/instrument.h"
#include "common/wire/session_messages.h"
#include "proto/wire.pb.h"

namespace trocar::page {
namespace {

constexpr std::size_t kTokenBytes = 16;
constexpr std::size_t kMostHands = 2;

std::string text_at(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
}

wire::Role role_named(const std::string& name) {
  for (const auto& known : wire::kRoles)
    if (known.name == name) return known.role;
  return wire::Role::Unknown;
}

// Fills the instruments by their names; false: one is unknown, or there are too many.
bool read_tools(const Json& json, std::vector<tool::ToolShape>& tools) {
  const auto found = json.find("tools");
  if (found == json.end()) return true;
  if (!found->is_array() || found->size() > kMostHands) return false;
  for (const auto& name : *found) {
    const auto* const known =
        name.is_string() ? tool::find_instrument(name.get<std::string>()) : nullptr;
    if (known == nullptr) return false;
    tools.push_back(known->shape);
  }
  return true;
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
  request.role = role_named(text_at(json, "role"));
  if (request.role == wire::Role::Unknown)
    return JoinRefusal{JoinFault::Form,
                       "a browser joins as surgeon, assistant, instructor or observer"};
  request.tools.clear();
  if (!read_tools(json, request.tools) ||
      (!request.tools.empty() && !wire::rights_of(request.role).may_have_tools))
    return JoinRefusal{JoinFault::Form,
                       "a surgeon or an assistant brings one or two instruments of the table"};
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
                             .return_token = request.return_token,
                             .tools = request.tools});
}

}  // namespace trocar::page
