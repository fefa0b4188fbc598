#include "server/session/replication/messages.h"

#include <cmath>

#include "common/base/version.h"
#include "common/wire/figure_messages.h"
#include "common/wire/haptic_messages.h"
#include "common/wire/surface_messages.h"
#include "common/wire/tool_shape.h"
#include "proto/wire.pb.h"

namespace trocar::replication {
namespace {

static_assert(static_cast<int>(wire::ClaimOutcome::RefusedHeld) == proto::CLAIM_REFUSED_HELD &&
              static_cast<int>(wire::ClaimOutcome::RefusedNothingInReach) ==
                  proto::CLAIM_REFUSED_NOTHING_IN_REACH &&
              static_cast<int>(wire::ClaimOutcome::Released) == proto::CLAIM_RELEASED &&
              static_cast<int>(wire::ClaimOutcome::TakenOver) == proto::CLAIM_TAKEN_OVER &&
              static_cast<int>(wire::ClaimOutcome::Expired) == proto::CLAIM_EXPIRED &&
              static_cast<int>(wire::ClaimOutcome::Slipped) == proto::CLAIM_SLIPPED &&
              wire::kClaimOutcomes == proto::ClaimOutcome_ARRAYSIZE);
static_assert(static_cast<int>(wire::RecordingStatus::Failed) == proto::RECORDING_FAILED);

void write(const Vec3f& from, proto::Vec3& to) {
  to.set_x(from.x);
  to.set_y(from.y);
  to.set_z(from.z);
}

void write(const Quatf& from, proto::Quat& to) {
  to.set_x(from.x);
  to.set_y(from.y);
  to.set_z(from.z);
  to.set_w(from.w);
}

std::string name_of_holder(ToolSlot tool, const participants::Roster& roster) {
  const auto* participant = roster.find(tool.owner());
  return participant ? participant->name : "somebody who has left";
}

const tool::ToolShape* find_shape(ToolSlot tool, const participants::Roster& roster) {
  const auto* participant = roster.find(tool.owner());
  const auto number = static_cast<std::size_t>(tool.number());
  return participant && number < participant->tools.size() ? &participant->tools[number] : nullptr;
}

}  // namespace

wire::SharedBytes encode_welcome(ParticipantSlot slot, std::uint64_t organ_hash, bool has_datagrams,
                                 const participants::ReturnToken* token,
                                 std::uint32_t return_seconds) {
  proto::Envelope envelope;
  auto& welcome = *envelope.mutable_welcome();
  welcome.set_protocol_major(kProtocolMajor);
  welcome.set_protocol_minor(kProtocolMinor);
  welcome.set_sim_version(kSimVersion);
  welcome.set_participant(slot.value);
  welcome.set_organ_hash(organ_hash);
  welcome.set_tick_us(static_cast<std::uint32_t>(kTickNanoseconds / 1000));
  welcome.set_ticks_per_frame(static_cast<std::uint32_t>(kTicksPerFrame));
  welcome.set_has_datagrams(has_datagrams);
  if (token) {
    welcome.set_return_token(token->data(), token->size());
    welcome.set_return_seconds(return_seconds);
  }
  return wire::encode_envelope(envelope);
}

void describe(const std::vector<participants::Participant>& present, proto::Participants& list) {
  for (const auto& participant : present) {
    auto& entry = *list.add_participant();
    entry.set_slot(participant.slot.value);
    entry.set_name(participant.name);
    entry.set_role(static_cast<proto::Role>(participant.role));
    entry.set_is_away(participant.is_away);
    entry.set_frozen_by(participant.frozen_by);
    entry.set_lent_tools(participant.lent_tools);
    entry.set_leads_view(participant.leads_view);
    entry.set_relayed_watchers(participant.relayed);
    for (const auto& shape : participant.tools) {
      wire::write(shape, *entry.add_tool());
    }
  }
}

wire::SharedBytes encode_participants(const std::vector<participants::Participant>& present,
                                      bool is_closed, std::span<const std::string> waiting) {
  proto::Envelope envelope;
  auto& list = *envelope.mutable_participants();
  describe(present, list);
  list.set_is_closed(is_closed);
  for (const auto& name : waiting) list.add_waiting(name);
  return wire::encode_envelope(envelope);
}

std::vector<wire::SharedBytes> encode_fine_surface(const wire::FineSurface& surface) {
  std::vector<wire::SharedBytes> messages;
  for (auto& part : wire::parts_of(surface)) {
    proto::Envelope envelope;
    envelope.mutable_fine_surface_part()->Swap(&part);
    messages.push_back(wire::encode_envelope(envelope));
  }
  return messages;
}

wire::SharedBytes encode_topology(const wire::SurfaceLayout& layout,
                                  const std::string& organ_name) {
  proto::Envelope envelope;
  wire::write(layout, organ_name, *envelope.mutable_surface_topology());
  return wire::encode_envelope(envelope);
}

wire::SharedBytes encode_surface_change(const wire::SurfaceChange& change,
                                        const wire::SurfaceLayout& layout,
                                        std::uint64_t server_time_us) {
  proto::Envelope envelope;
  wire::write(change, layout, *envelope.mutable_surface_change());
  envelope.mutable_surface_change()->set_server_time_us(server_time_us);
  return wire::encode_envelope(envelope);
}

void describe(const step::PublishedFrame& frame, proto::FrameState& state) {
  state.set_frame(frame.frame);
  state.set_tick(frame.tick);
  for (const auto& tool : frame.tools) {
    auto& entry = *state.add_tool();
    entry.set_tool(tool.tool.value);
    write(tool.world_from_tool.position, *entry.mutable_position_m());
    write(tool.world_from_tool.orientation, *entry.mutable_orientation());
    entry.set_verb(static_cast<proto::Verb>(tool.verb));
    write(tool.force_n, *entry.mutable_force_n());
    entry.set_contact_nodes(tool.contact_nodes);
    entry.set_has_claim(tool.has_claim);
    entry.set_penetration_m(tool.penetration_m);
    entry.set_is_silent(tool.is_silent);
    entry.set_is_inside(tool.is_inside);
    write(tool.torque_nm, *entry.mutable_torque_nm());
    if (tool.world_from_proxy != tool.world_from_tool) {
      write(tool.world_from_proxy.position, *entry.mutable_proxy_position_m());
      write(tool.world_from_proxy.orientation, *entry.mutable_proxy_orientation());
    }
  }
  for (std::size_t begin = 0; begin < frame.regions.size();) {
    std::size_t end = begin + 1;
    while (end < frame.regions.size() && frame.regions[end] == frame.regions[begin]) ++end;
    state.add_region_runs(frame.regions[begin]);
    state.add_region_runs(static_cast<std::uint32_t>(end - begin));
    begin = end;
  }
  wire::write(frame.figures, state);
  if (!frame.threads.empty()) state.set_threads(frame.threads.data(), frame.threads.size());
}

wire::SharedBytes encode_frame_state(const step::PublishedFrame& frame) {
  proto::Envelope envelope;
  describe(frame, *envelope.mutable_frame_state());
  return wire::encode_envelope(envelope);
}

std::string describe(const hands::ClaimEvent& event, const participants::Roster& roster) {
  const std::string who = name_of_holder(event.tool, roster);
  const std::string holder = name_of_holder(event.holder, roster);
  const bool is_grasp = event.verb == tool::Verb::Grasp, is_cut = event.verb == tool::Verb::Cut;
  switch (event.outcome) {
    case hands::ClaimOutcome::Granted:
      return who + (is_grasp ? " has a grasp" : is_cut ? " cuts" : " pushes");
    case hands::ClaimOutcome::RefusedHeld:
      return (is_cut ? "the blade is stopped: tissue ahead is held by " : "held by ") + holder +
             ": wait, or ask " + holder + " to let go";
    case hands::ClaimOutcome::RefusedNothingInReach: {
      const auto* shape = find_shape(event.tool, roster);
      const auto reach_mm = std::lround((shape ? *shape : tool::ToolShape{}).reach_m * 1000);
      return "nothing in reach of " + who + ": bring the tip within " + std::to_string(reach_mm) +
             " mm of the surface";
    }
    case hands::ClaimOutcome::Released:
      return who + (is_grasp ? " let go" : is_cut ? " stopped cutting" : " stopped pushing");
    case hands::ClaimOutcome::TakenOver:
      return who + " was silent: " + holder + " took over";
    case hands::ClaimOutcome::Expired:
      if (!is_grasp) return who + " was silent: the " + (is_cut ? "cut" : "push") + " has ended";
      return who + " was silent for " + std::to_string(hands::kAbandonTicks / kTicksPerSecond) +
             " s: the grasp was let go";
    case hands::ClaimOutcome::Slipped:
      return who + " lost the grasp: the tissue was pulled out of the jaws";
  }
  return {};
}

void describe(const hands::ClaimEvent& event, const participants::Roster& roster,
              proto::ClaimEvent& message) {
  message.set_tick(event.tick);
  message.set_tool(event.tool.value);
  message.set_verb(static_cast<proto::Verb>(event.verb));
  message.set_outcome(static_cast<proto::ClaimOutcome>(event.outcome));
  if (event.holder.is_valid()) {
    message.set_holder(event.holder.value);
    message.set_holder_name(name_of_holder(event.holder, roster));
  }
  message.set_text(describe(event, roster));
}

wire::SharedBytes encode_claim_event(const hands::ClaimEvent& event,
                                     const participants::Roster& roster) {
  proto::Envelope envelope;
  describe(event, roster, *envelope.mutable_claim_event());
  return wire::encode_envelope(envelope);
}

void describe(const step::MarkEvent& event, const std::string& name, proto::MarkEvent& message) {
  const bool is_return = event.action == hands::MarkAction::Return;
  message.set_tick(event.tick);
  message.set_action(static_cast<proto::MarkAction>(event.action));
  message.set_is_done(event.is_done);
  message.set_name(name);
  const std::string end = name.empty() ? "" : " \"" + name + "\"";
  message.set_text(!event.is_done ? "there is no mark to return to: set one first"
                   : is_return    ? "the instructor has returned the organ to the mark" + end
                   : name.empty() ? "the instructor has marked the organ as it is"
                                  : "the instructor has marked the organ as it is:" + end);
}

wire::SharedBytes encode_mark_refusal(hands::MarkAction action, Tick tick, const std::string& name,
                                      const std::string& why) {
  proto::Envelope envelope;
  auto& message = *envelope.mutable_mark_event();
  message.set_tick(tick);
  message.set_action(static_cast<proto::MarkAction>(action));
  message.set_name(name);
  const bool is_return = action == hands::MarkAction::Return;
  message.set_text((is_return ? "not returned to the mark: " : "not marked: ") + why);
  return wire::encode_envelope(envelope);
}

wire::SharedBytes encode_recording(const wire::RecordingState& state) {
  proto::Envelope envelope;
  auto& message = *envelope.mutable_recording_state();
  message.set_status(static_cast<proto::RecordingStatus>(state.status));
  message.set_frames_missing(state.frames_missing);
  message.set_text(state.text);
  return wire::encode_envelope(envelope);
}

wire::SharedBytes encode_haptic_law(const wire::HapticLaw& law) {
  proto::Envelope envelope;
  wire::write(law, *envelope.mutable_haptic_law());
  return wire::encode_envelope(envelope);
}

wire::SharedBytes encode_touch(const step::PublishedFrame& frame, ParticipantSlot slot) {
  proto::Envelope envelope;
  auto& patches = *envelope.mutable_haptic_patches();
  for (const auto& tool : frame.tools) {
    if (tool.tool.owner() != slot || tool.touch.echo_time_us == 0) continue;
    auto patch = tool.touch;
    patch.tool = static_cast<std::uint8_t>(tool.tool.number());
    patch.sequence = static_cast<std::uint32_t>(frame.frame);
    wire::write(patch, *patches.add_patch());
  }
  return patches.patch_size() > 0 ? wire::encode_envelope(envelope) : nullptr;
}

wire::SharedBytes encode_barrier(const step::PublishedFrame& frame) {
  proto::Envelope envelope;
  envelope.mutable_barrier()->set_frame(frame.frame);
  envelope.mutable_barrier()->set_surface_crc(frame.surface_crc);
  if (!frame.blood.empty()) envelope.mutable_barrier()->set_blood_crc(frame.blood_crc);
  return wire::encode_envelope(envelope);
}

}  // namespace trocar::replication
