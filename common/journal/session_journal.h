#pragma once

// Reads the journal of a session, finished or cut short. Ticks in and out; the container's damage
// comes back as an error of the call that met it, after everything readable was visited. One
// thread.

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/journal/mcap_reader.h"
#include "common/journal/recording_end.h"
#include "common/journal/session_topics.h"
#include "proto/journal.pb.h"
#include "proto/organ.pb.h"
#include "proto/wire.pb.h"

namespace trocar::journal {

// A session has as many recordings at most; one that is merged of them has as many joins.
inline constexpr std::size_t kMostParts = 64;

// Its texts are printable, whoever wrote the recording.
struct SessionInfo {
  std::uint64_t start_utc_ns = 0;
  std::uint32_t sim_version = 0;
  std::string protocol;  // "major.minor"
  std::string organ_name;
  std::uint64_t organ_hash = 0;
  // More than tools acts on the tissue. loads() has it, but for journals that were written before
  // there were loads in them: their ticks cannot be simulated again.
  bool has_external_loads = false;
  // A scenario began otherwise than with the organ at rest: ticks follow from the first snapshot.
  bool starts_from_snapshot = false;
  // A scenario solved for the forces of averaged strain, whatever a session of that organ does.
  bool has_implicit_strain = false;
  std::optional<Continuation> continues;         // with which journal's session it goes on
  std::optional<Continuation> trimmed;           // of which journal it is what came after a tick
  Tick last_tick = 0;                            // of the last message
  std::vector<proto::Participant> participants;  // everyone who was ever in, in order of joining
  std::uint64_t gap_messages = 0;                // that the session dropped while recording
  std::vector<Tick> joins;  // after these, another server has gone on; kMostParts at most
  // By its writer; not if it was repaired, or if its end counts other messages than its summary.
  bool is_finished = false;
  std::string summary;  // one line for people

  // The tick after which this journal begins.
  Tick begin_tick() const { return continues ? continues->tick : trimmed ? trimmed->tick : 0; }
  // The state after that tick is that of the first snapshot, and does not follow from the organ.
  bool begins_with_snapshot() const { return continues || trimmed || starts_from_snapshot; }
};

template <typename Message>
using TickVisitor = std::function<bool(Tick, const Message&)>;  // false stops

class SessionJournal {
 public:
  static Result<std::unique_ptr<SessionJournal>> open(const std::string& path);

  const SessionInfo& info() const { return info_; }
  const McapReader& container() const { return *mcap_; }

  Result<proto::Organ> organ();
  // Nothing if only tools act, or if the journal lacks them.
  Result<std::optional<proto::ExternalLoads>> loads();
  // Nothing if the session did not bleed.
  Result<std::optional<proto::BleedingRules>> bleeding();
  Result<std::optional<proto::ThreadRules>> threads();

  // Records of ticks in [from, to], in order.
  Status read_tick_records(Tick from, Tick to, const TickVisitor<proto::TickRecord>& visitor);
  // Deltas of frames with tick in [from, to], in order.
  Status read_surface_deltas(Tick from, Tick to, const TickVisitor<proto::SurfaceFrame>& visitor);
  // Surfaces that need no frame before them, likewise.
  Status read_surface_keys(Tick from, Tick to, const TickVisitor<proto::SurfaceFrame>& visitor);
  Status read_topology_changes(Tick from, Tick to,
                               const TickVisitor<proto::SurfaceChange>& visitor);
  Status read_frame_states(Tick from, Tick to, const TickVisitor<proto::FrameState>& visitor);
  Status read_participants(Tick from, Tick to, const TickVisitor<proto::Participants>& visitor);
  Status read_claims(Tick from, Tick to, const TickVisitor<proto::ClaimLog>& visitor);
  Status read_hands(Tick from, Tick to, const TickVisitor<proto::HandLog>& visitor);
  Status read_lessons(Tick from, Tick to, const TickVisitor<proto::LessonRecord>& visitor);
  Status read_snapshots(Tick from, Tick to, const TickVisitor<proto::WorldSnapshot>& visitor);

  // Every message there is, in the order in which they were recorded, with its channel's topic.
  using BytesVisitor = std::function<bool(std::string_view topic, Tick, BytesView)>;
  ReadReport read_all(const BytesVisitor& visitor);
  EndReport check_end() { return journal::check_end(*mcap_); }  // reads every message

  // The latest at or before `tick`; nothing if there is none.
  Result<std::optional<proto::WorldSnapshot>> snapshot_before(Tick tick);
  Result<std::optional<proto::SurfaceFrame>> surface_key_before(Tick tick);
  Result<std::optional<proto::SurfaceTopology>> topology_before(Tick tick);
  Result<std::optional<proto::Participants>> participants_before(Tick tick);
  Result<std::optional<proto::FrameState>> frame_state_before(Tick tick);

 private:
  explicit SessionJournal(std::unique_ptr<McapReader> mcap) : mcap_(std::move(mcap)) {}
  Status read_info();
  Status read_participants();
  Error not_a(JournalTopic topic, std::uint64_t log_time) const;
  template <typename Message>
  Status read_topic(JournalTopic topic, Tick from, Tick to, const TickVisitor<Message>& visitor);
  template <typename Message>
  Result<std::optional<Message>> last(JournalTopic topic, Tick tick);

  std::unique_ptr<McapReader> mcap_;
  JournalTimes times_;
  SessionInfo info_;
};

}  // namespace trocar::journal
