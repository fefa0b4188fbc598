#include "server/session/replication/validation.h"

#include <array>
#include <cmath>

#include "common/base/printable.h"
#include "common/base/version.h"
#include "common/wire/hand_report_messages.h"
#include "common/wire/lesson.h"
#include "common/wire/tool_shape.h"
#include "proto/wire.pb.h"
#include "server/session/participants/absences.h"

namespace trocar::replication {
namespace {

static_assert(static_cast<int>(TeachAction::HandOver) == proto::TEACH_HAND_OVER &&
              kTeachActions == proto::TeachAction_ARRAYSIZE);
constexpr std::size_t kSecretBytes = 5;
static_assert(static_cast<int>(tool::Verb::Grasp) == proto::VERB_GRASP);
static_assert(static_cast<int>(tool::Verb::Cut) == proto::VERB_CUT);
static_assert(tool::kVerbCount == proto::Verb_ARRAYSIZE);

Error bad(std::string message) {
  return {ErrorCode::BadMessage, std::move(message)};
}

}  // namespace

Result<HelloRequest> check_hello(const proto::Hello& hello, EndReason& reason) {
  if (hello.protocol_major() != kProtocolMajor) {
    reason = EndReason::Version;
    return bad("Hello.protocol_major: this server speaks protocol " +
               std::to_string(kProtocolMajor) + "." + std::to_string(kProtocolMinor) +
               ", you speak " + std::to_string(hello.protocol_major()) + "." +
               std::to_string(hello.protocol_minor()) + ": use client and server of one release");
  }
  if (wire::role_of(hello.role()) == wire::Role::Unknown) {
    reason = EndReason::Role;
    return bad("Hello.role: " + std::to_string(static_cast<int>(hello.role())) + " is none of " +
               wire::list_roles());
  }
  reason = EndReason::ProtocolError;
  if (hello.tool_size() > kToolsPerHand)
    return bad("Hello.tool: " + std::to_string(hello.tool_size()) + " tools, at most 2");
  if (!hello.join_secret().empty() && hello.join_secret().size() != kSecretBytes)
    return bad("Hello.join_secret: " + std::to_string(hello.join_secret().size()) +
               " bytes, a code has 5");
  const auto token_bytes = hello.return_token().size();
  if (token_bytes != 0 && token_bytes != participants::kReturnTokenBytes)
    return bad("Hello.return_token: " + std::to_string(token_bytes) + " bytes, a token has " +
               std::to_string(participants::kReturnTokenBytes));
  HelloRequest request;
  request.protocol_minor = hello.protocol_minor();
  request.name = hello.name();
  request.acks_every_frame = hello.acks_every_frame();
  request.role = wire::role_of(hello.role());
  request.join_secret.assign(hello.join_secret().begin(), hello.join_secret().end());
  request.can_return = hello.can_return();
  request.relays = hello.relays();
  request.return_token.assign(hello.return_token().begin(), hello.return_token().end());
  for (const auto& tool : hello.tool()) request.tools.push_back(wire::read(tool));
  return request;
}

Status check_place(const proto::Vec3& place) {
  const Vec3f position{place.x(), place.y(), place.z()};
  if (!is_finite(position)) return Error{ErrorCode::BadMessage, "not finite"};
  // Compared as |p|^2 in double: a float would overflow for large coordinates.
  const Vec3d wide = to_double(position);
  if (length_squared(wide) > double{kMaxDistanceFromOriginM} * kMaxDistanceFromOriginM)
    return Error{ErrorCode::BadMessage, "farther than 2 m from the origin"};
  return {};
}

Result<CheckedSample> check_tool_sample(const proto::ToolSample& sample, std::size_t tool_count) {
  if (sample.tool() >= tool_count)
    return bad("ToolSample.tool: " + std::to_string(sample.tool()) + ", you have " +
               std::to_string(tool_count) + " (counted from 0)");
  if (!sample.has_position_m() || !sample.has_orientation())
    return bad("ToolSample: position_m and orientation must be there");
  const auto& p = sample.position_m();
  const auto& q = sample.orientation();
  const Vec3f position{p.x(), p.y(), p.z()};
  if (const auto placed = check_place(p); !placed)
    return bad("ToolSample.position_m: " + placed.error().message);
  const Quatf orientation{q.x(), q.y(), q.z(), q.w()};
  // Not finite fails here too: every comparison with NaN is false.
  if (!(std::abs(norm(orientation) - 1.0f) <= kMaxQuaternionError))
    return bad("ToolSample.orientation: not of unit length (within 0.001)");
  if (sample.verb() < 0 || sample.verb() >= tool::kVerbCount)
    return bad("ToolSample.verb: " + std::to_string(static_cast<int>(sample.verb())) +
               " is none of none (0), push (1), grasp (2), cut (3)");
  CheckedSample checked;
  checked.tool = static_cast<int>(sample.tool());
  checked.sequence = sample.sequence();
  checked.sample = {{position, normalized(orientation)}, static_cast<tool::Verb>(sample.verb())};
  checked.client_time_us = sample.client_time_us();
  return checked;
}

const char* name_of(TeachAction action) {
  static constexpr std::array<const char*, kTeachActions> kNames{
      "none",  "freeze", "release", "take-claim", "expel",    "rename",    "admit",
      "close", "open",   "end",     "note",       "chat",     "give-view", "end-view",
      "wipe",  "pause",  "go-on",   "slow",       "hand-over"};
  return kNames[static_cast<std::size_t>(action)];
}

bool is_about_one(TeachAction action) {
  switch (action) {
    case TeachAction::Freeze:
    case TeachAction::Release:
    case TeachAction::TakeClaim:
    case TeachAction::Expel:
    case TeachAction::Rename:
    case TeachAction::GiveView:
    case TeachAction::HandOver:
      return true;
    default:
      return false;
  }
}

namespace {

// Most bytes of its text; 0: it has none.
std::size_t most_text(TeachAction action) {
  switch (action) {
    case TeachAction::Expel:
      return wire::kMostReason;
    case TeachAction::Rename:
    case TeachAction::Admit:
    case TeachAction::Note:
    case TeachAction::Chat:
      return wire::kMostLessonText;
    default:
      return 0;
  }
}

}  // namespace

Result<TeachOrder> check_teach(const proto::TeachRequest& request) {
  const int action = request.action();
  if (action <= 0 || action >= kTeachActions)
    return bad("TeachRequest.action: " + std::to_string(action) + " is none of 1 to " +
               std::to_string(kTeachActions - 1));
  TeachOrder order{.action = static_cast<TeachAction>(action),
                   .participant = {},
                   .name = request.name(),
                   .text = request.text(),
                   .rate = 0,
                   .tool = 0,
                   .receiver = {},
                   .receiver_name = {}};
  if (is_about_one(order.action)) {
    if (request.participant() >= kMaxParticipants)
      return bad("TeachRequest.participant: " + std::to_string(request.participant()) +
                 " is no slot, the last is " + std::to_string(kMaxParticipants - 1));
    order.participant = {static_cast<std::uint8_t>(request.participant())};
  }
  const auto most = most_text(order.action);
  if (order.text.size() > most || (most > 0 && order.text.empty()))
    return bad("TeachRequest.text: " + std::to_string(order.text.size()) + " bytes, " +
               (most > 0 ? "1 to " + std::to_string(most) + " are allowed"
                         : std::string("this action has no text")));
  if (!is_printable(order.text))
    return bad("TeachRequest.text: it must be printable UTF-8, in one line");
  const bool is_slow = order.action == TeachAction::Slow;
  if (is_slow && !(request.rate() >= wire::kLeastPace && request.rate() <= 1))
    return bad("TeachRequest.rate: it must be from 0.25 to 1");
  if (!is_slow && request.rate() != 0) return bad("TeachRequest.rate: this action has no rate");
  order.rate = request.rate();
  if (order.action != TeachAction::HandOver) return order;
  if (request.tool() >= static_cast<std::uint32_t>(kToolsPerHand))
    return bad("TeachRequest.tool: " + std::to_string(request.tool()) + ", a hand has 0 and 1");
  if (request.receiver() >= kMaxParticipants)
    return bad("TeachRequest.receiver: " + std::to_string(request.receiver()) +
               " is no slot, the last is " + std::to_string(kMaxParticipants - 1));
  order.tool = static_cast<int>(request.tool());
  order.receiver = {static_cast<std::uint8_t>(request.receiver())};
  order.receiver_name = request.receiver_name();
  return order;
}

Status check_view(const proto::ViewRequest& request) {
  const Vec3f eye{request.eye_m().x(), request.eye_m().y(), request.eye_m().z()};
  const Vec3f target{request.target_m().x(), request.target_m().y(), request.target_m().z()};
  const auto is_near = [](const Vec3f& place) {
    return is_finite(place) && length_squared(to_double(place)) <=
                                   double{wire::kMostViewDistanceM} * wire::kMostViewDistanceM;
  };
  if (!is_near(eye) || !is_near(target))
    return bad("ViewRequest: eye_m and target_m must be finite and within 10 m of the origin");
  if (!(length(eye - target) >= wire::kLeastViewM))
    return bad("ViewRequest: eye_m and target_m must be at least 1 mm apart");
  return {};
}

Result<std::vector<SurfacePoint>> check_stroke(const proto::StrokeRequest& request) {
  const auto count = static_cast<std::size_t>(request.triangle_size());
  if (count == 0 || count > wire::kMostStrokePoints)
    return bad("StrokeRequest.triangle: " + std::to_string(count) + " points, 1 to " +
               std::to_string(wire::kMostStrokePoints) + " are allowed");
  if (static_cast<std::size_t>(request.weight_size()) != 2 * count)
    return bad("StrokeRequest.weight: " + std::to_string(request.weight_size()) +
               " numbers, each point has two");
  std::vector<SurfacePoint> points;
  for (int i = 0; i < request.triangle_size(); ++i) {
    const float b = request.weight(2 * i), c = request.weight(2 * i + 1);
    if (!(b >= 0 && c >= 0 && b + c <= 1.0001f))
      return bad("StrokeRequest.weight: of point " + std::to_string(i) +
                 ": weights are 0 to 1, and together at most 1");
    points.push_back({request.triangle(i), {b, c}});
  }
  return points;
}

Result<wire::HandReport> check_hand_report(const proto::HandReport& report,
                                           std::size_t tool_count) {
  if (report.tool() >= tool_count)
    return bad("HandReport.tool: " + std::to_string(report.tool()) + ", you have " +
               std::to_string(tool_count) + " (counted from 0)");
  return wire::read(report);
}

}  // namespace trocar::replication
