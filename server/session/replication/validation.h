#pragma once

// A client's message is checked field by field and turned into our own types. Everything that comes
// from a socket passes here first; what is wrong with it is an error line that goes back to the
// client, and the reason its session ends with.

#include <array>
#include <string>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/tool/tool.h"
#include "common/wire/hand_report.h"
#include "common/wire/session_messages.h"
#include "server/session/participants/roster.h"

namespace trocar::proto {
class HandReport;
class Hello;
class StrokeRequest;
class TeachRequest;
class ToolSample;
class Vec3;
class ViewRequest;
}  // namespace trocar::proto

namespace trocar::replication {

inline constexpr float kMaxDistanceFromOriginM = 2.0f;
inline constexpr float kMaxQuaternionError = 1e-3f;

using wire::EndReason;
using wire::kEndReasonCount;

// The session of one client ends so: with a Goodbye that says why.
struct Ending {
  EndReason reason = EndReason::Unspecified;
  std::string text;
};

struct HelloRequest {
  std::uint32_t protocol_minor = 0;
  std::string name;  // not yet checked: the roster does
  participants::Role role = participants::Role::Observer;
  std::vector<tool::ToolShape> tools;  // not yet checked
  Bytes join_secret;                   // not yet checked: the gate does
  bool acks_every_frame = false;
  bool can_return = false;
  bool relays = false;
  Bytes return_token;  // not yet checked; empty: none
};
// `reason` is set on error.
Result<HelloRequest> check_hello(const proto::Hello& hello, EndReason& reason);

struct CheckedSample {
  int tool = 0;  // number, below the participant's tool count
  std::uint32_t sequence = 0;
  tool::ToolSample sample;  // orientation of unit length
  std::uint64_t client_time_us = 0;
};
Result<CheckedSample> check_tool_sample(const proto::ToolSample& sample, std::size_t tool_count);

// An error if it is not finite, or beyond kMaxDistanceFromOriginM.
Status check_place(const proto::Vec3& place);

// Values of proto::TeachAction.
enum class TeachAction : std::uint8_t {
  None = 0,
  Freeze = 1,
  Release = 2,
  TakeClaim = 3,
  Expel = 4,
  Rename = 5,
  Admit = 6,
  Close = 7,
  Open = 8,
  End = 9,
  Note = 10,
  Chat = 11,
  GiveView = 12,
  EndView = 13,
  Wipe = 14,
  Pause = 15,
  GoOn = 16,
  Slow = 17,
  HandOver = 18,
};
inline constexpr int kTeachActions = 19;
// For the audit log, such as "take-claim".
const char* name_of(TeachAction action);
// Whether it is about one participant.
bool is_about_one(TeachAction action);

struct TeachOrder {
  TeachAction action = TeachAction::None;
  ParticipantSlot participant;  // valid where it is about one
  std::string name;             // that participant's, as the client knows it
  std::string text;             // printable; empty where the action has none
  float rate = 0;               // of slow time
  // A handover gives this tool of the participant to this one, as the client knows them.
  int tool = 0;
  ParticipantSlot receiver;
  std::string receiver_name;
};
Result<TeachOrder> check_teach(const proto::TeachRequest& request);

// Both places finite, within kMostViewDistanceM, and kLeastViewM apart.
Status check_view(const proto::ViewRequest& request);

struct SurfacePoint {
  std::uint32_t triangle = 0;
  std::array<float, 2> weight{};  // of the second and third corner
};
// Returns 1 to kMostStrokePoints points; triangles need not exist.
Result<std::vector<SurfacePoint>> check_stroke(const proto::StrokeRequest& request);

Result<wire::HandReport> check_hand_report(const proto::HandReport& report, std::size_t tool_count);

}  // namespace trocar::replication
