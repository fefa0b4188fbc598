#pragma once

// Builders of what the server says, each as one framed, encoded, immutable buffer.

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "common/wire/framing.h"
#include "common/wire/haptic_patch.h"
#include "common/wire/recording_state.h"
#include "common/wire/surface_layout.h"
#include "server/session/participants/absences.h"
#include "server/session/participants/roster.h"
#include "server/session/replication/validation.h"
#include "server/tissue/hands/claims.h"
#include "server/tissue/step/published_frame.h"

namespace trocar::proto {
class ClaimEvent;
class FrameState;
class MarkEvent;
class Participants;
}  // namespace trocar::proto

namespace trocar::replication {

using wire::encode_goodbye;
using wire::encode_pong;

// Messages that clients and journal get alike.
void describe(const std::vector<participants::Participant>& present, proto::Participants& message);
void describe(const step::PublishedFrame& frame, proto::FrameState& message);
void describe(const hands::ClaimEvent& event, const participants::Roster& roster,
              proto::ClaimEvent& message);

// `token`: with which the participant may come back; null: not at all.
wire::SharedBytes encode_welcome(ParticipantSlot slot, std::uint64_t organ_hash, bool has_datagrams,
                                 const participants::ReturnToken* token = nullptr,
                                 std::uint32_t return_seconds = 0);
wire::SharedBytes encode_participants(const std::vector<participants::Participant>& present,
                                      bool is_closed, std::span<const std::string> waiting);
std::vector<wire::SharedBytes> encode_fine_surface(const wire::FineSurface& surface);
wire::SharedBytes encode_topology(const wire::SurfaceLayout& layout, const std::string& organ_name);
// `layout`: the one that the change was applied to.
wire::SharedBytes encode_surface_change(const wire::SurfaceChange& change,
                                        const wire::SurfaceLayout& layout,
                                        std::uint64_t server_time_us);
wire::SharedBytes encode_frame_state(const step::PublishedFrame& frame);
wire::SharedBytes encode_claim_event(const hands::ClaimEvent& event,
                                     const participants::Roster& roster);
// `name`: of the mark; empty: it has none.
void describe(const step::MarkEvent& event, const std::string& name, proto::MarkEvent& message);
// To who asked; nothing has been done.
wire::SharedBytes encode_mark_refusal(hands::MarkAction action, Tick tick, const std::string& name,
                                      const std::string& why);
wire::SharedBytes encode_recording(const wire::RecordingState& state);
wire::SharedBytes encode_haptic_law(const wire::HapticLaw& law);
// Returns what the tools of one participant feel in a frame; null: no hand feels any of them.
wire::SharedBytes encode_touch(const step::PublishedFrame& frame, ParticipantSlot slot);
wire::SharedBytes encode_barrier(const step::PublishedFrame& frame);

// One line for a person about what became of a claim: by whom it is held and what to do.
std::string describe(const hands::ClaimEvent& event, const participants::Roster& roster);

}  // namespace trocar::replication
