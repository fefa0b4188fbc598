#include "server/session/replication/validation.h"

#include <array>
#include <cmath>

#include "common/base/version.h"
#include "common/wire/hand_report_messages.h"
#include "common/wire/tool_shape.h"
#include "proto/wire.pb.h"
#include "server/session/participants/absences.h"

namespace trocar::replication {
namespace {

static_assert(static_cast<int>(EndReason::Timeout) == proto::GOODBYE_TIMEOUT);
static_assert(static_cast<int>(EndReason::NameInvalid) == proto::GOODBYE_NAME_INVALID);
static_assert(kEndReasonCount == proto::GoodbyeReason_ARRAYSIZE);
constexpr std::size_t kSecretBytes = 5;
static_assert(static_cast<int>(tool::Verb::Grasp) == proto::VERB_GRASP);
static_assert(static_cast<int>(tool::Verb::Cut) == proto::VERB_CUT);
static_assert(tool::kVerbCount == proto::Verb_ARRAYSIZE);

Error bad(std::string message) {
  return {ErrorCode::BadMessage, std::move(message)};
}

}  // namespace

const char* name_of(EndReason reason) {
  static constexpr std::array<const char*, kEndReasonCount> kNames{
      "unspecified",  "server-closing", "protocol-error", "version",
      "full",         "name-taken",     "role",           "too-slow",
      "timeout",      "code-wrong",     "code-expired",   "code-used-up",
      "code-revoked", "too-many-tries", "code-role",      "name-invalid"};
  return kNames[static_cast<std::size_t>(reason)];
}

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

Result<wire::HandReport> check_hand_report(const proto::HandReport& report,
                                           std::size_t tool_count) {
  if (report.tool() >= tool_count)
    return bad("HandReport.tool: " + std::to_string(report.tool()) + ", you have " +
               std::to_string(tool_count) + " (counted from 0)");
  return wire::read(report);
}

}  // namespace trocar::replication
