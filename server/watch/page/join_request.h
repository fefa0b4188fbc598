#pragma once

// The first message of a page: who wants to join which session, as JSON text. What follows on the
// WebSocket are Envelopes without their length, in both directions.
//
//   {"code": "7K3M-...", "name": "Ann", "role": "surgeon", "tools": ["grasper", "scissors"]}
//
// "tools" are the instruments of a role that holds some, by name: one for each hand, two at most.
// "session" names one of several ("HOST:PORT"), "token" is that of the Welcome before, in
// hexadecimal, when a page comes back.

#include <optional>
#include <string>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/secure/join_code.h"
#include "common/tool/tool.h"
#include "common/wire/framing.h"
#include "common/wire/role.h"
#include "common/wire/session_messages.h"

namespace trocar::page {

inline constexpr std::size_t kMostJoinBytes = 2048;

struct JoinRequest {
  secure::JoinCode code;
  std::string name;
  wire::Role role = wire::Role::Observer;
  std::vector<tool::ToolShape> tools;  // none for a role without
  std::string session;                 // empty: the first
  Bytes return_token;                  // empty, or 16 bytes
};

enum class JoinFault { Form, Code };  // Code counts as a try

struct JoinRefusal {
  JoinFault fault = JoinFault::Form;
  std::string text;  // one line for the person
};

// Returns why somebody ends who is turned away for now: a newcomer for that `reason`; a page that
// comes back tries again after a timeout, until its place is given up.
wire::EndReason reason_to_wait(const JoinRequest& request, wire::EndReason reason);

// Nothing in `request` counts where a refusal comes back.
std::optional<JoinRefusal> read_join_request(BytesView text, JoinRequest& request);

// The Hello for the server, with its length.
wire::SharedBytes hello_of(const JoinRequest& request);

}  // namespace trocar::page
