#pragma once

// Writes the journal of a session. Ticks must not decrease from call to call, over all topics. The
// caller brings thread and queue; every call may block on the disk. publish_time_ns is UTC.

#include <array>
#include <memory>
#include <optional>
#include <string>

#include "common/base/ids.h"
#include "common/base/version.h"
#include "common/journal/mcap_writer.h"
#include "common/journal/recording_end.h"
#include "common/journal/session_topics.h"
#include "proto/journal.pb.h"
#include "proto/organ.pb.h"
#include "proto/wire.pb.h"

namespace trocar::journal {

struct SessionDescription {
  std::uint64_t start_utc_ns = 0;  // of tick 0; a set clock, never 0
  std::uint32_t sim_version = kSimVersion;
  std::uint32_t protocol_major = kProtocolMajor, protocol_minor = kProtocolMinor;
  std::string organ_name;
  std::uint64_t organ_hash = 0;
  bool has_external_loads = false;        // see SessionInfo
  bool starts_from_snapshot = false;      // likewise
  bool has_implicit_strain = false;       // likewise
  std::optional<Continuation> continues;  // nothing: it begins with the session
  std::optional<Continuation> trimmed;    // nothing: nothing was taken off its beginning
};

class SessionJournalWriter {
 public:
  // Fails if the file exists.
  static Result<std::unique_ptr<SessionJournalWriter>> create(
      const std::string& path, const SessionDescription& session,
      const McapWriterOptions& options = {});

  // `message` is an encoding of topic_message(topic).
  [[nodiscard]] Status write(JournalTopic topic, Tick tick, std::uint64_t publish_time_ns,
                             BytesView message);
  [[nodiscard]] Status write(JournalTopic topic, Tick tick, std::uint64_t publish_time_ns,
                             const google::protobuf::Message& message);
  [[nodiscard]] Status write_tool(ToolSlot tool, Tick tick, std::uint64_t publish_time_ns,
                                  const proto::ToolState& state);

  [[nodiscard]] Status write_organ(std::uint64_t now_ns, const proto::Organ& organ) {
    return write(JournalTopic::Organ, 0, now_ns, organ);
  }
  [[nodiscard]] Status write_snapshot(Tick tick, std::uint64_t now_ns,
                                      const proto::WorldSnapshot& snapshot) {
    return write(JournalTopic::Snapshot, tick, now_ns, snapshot);
  }
  [[nodiscard]] Status write_tick_batch(Tick tick, std::uint64_t now_ns,
                                        const proto::TickBatch& batch) {
    return write(JournalTopic::TickBatch, tick, now_ns, batch);
  }
  // Keyframe or delta, as the frame says.
  [[nodiscard]] Status write_surface(Tick tick, std::uint64_t now_ns,
                                     const proto::SurfaceFrame& frame) {
    const auto topic = frame.is_keyframe() ? JournalTopic::SurfaceKey : JournalTopic::SurfaceDelta;
    return write(topic, tick, now_ns, frame);
  }
  [[nodiscard]] Status write_topology(Tick tick, std::uint64_t now_ns,
                                      const proto::SurfaceTopology& topology) {
    return write(JournalTopic::Topology, tick, now_ns, topology);
  }
  [[nodiscard]] Status write_topology_change(Tick tick, std::uint64_t now_ns,
                                             const proto::SurfaceChange& change) {
    return write(JournalTopic::TopologyChange, tick, now_ns, change);
  }
  [[nodiscard]] Status write_participants(Tick tick, std::uint64_t now_ns,
                                          const proto::Participants& participants) {
    return write(JournalTopic::Participants, tick, now_ns, participants);
  }
  [[nodiscard]] Status write_claims(Tick tick, std::uint64_t now_ns,
                                    const proto::ClaimLog& claims) {
    return write(JournalTopic::Claims, tick, now_ns, claims);
  }
  [[nodiscard]] Status write_frame_state(Tick tick, std::uint64_t now_ns,
                                         const proto::FrameState& state) {
    return write(JournalTopic::FrameState, tick, now_ns, state);
  }
  [[nodiscard]] Status write_hands(Tick tick, std::uint64_t now_ns, const proto::HandLog& hands) {
    return write(JournalTopic::Hands, tick, now_ns, hands);
  }
  [[nodiscard]] Status write_gap(Tick tick, std::uint64_t now_ns, const proto::JournalGap& gap) {
    return write(JournalTopic::Gap, tick, now_ns, gap);
  }

  // In a chunk of its own, so that who reads overviews loads nothing else.
  [[nodiscard]] Status write_overview(Tick tick, std::uint64_t now_ns,
                                      const proto::Overview& overview);

  [[nodiscard]] Status write_metadata(const McapMetadata& metadata);
  [[nodiscard]] Status flush() { return mcap_->flush(); }
  // Once, at the session's end: writes what all messages add up to, signed by `key` unless it is
  // null, and the summary.
  [[nodiscard]] Status close(const secure::SigningKey* key = nullptr);
  std::uint64_t bytes_written() const { return mcap_->bytes_written(); }
  std::uint64_t sync_count() const { return mcap_->sync_count(); }
  const McapStatistics& statistics() const { return mcap_->statistics(); }

 private:
  SessionJournalWriter(std::unique_ptr<McapWriter> mcap, JournalTimes times);
  std::uint16_t schema_of(const google::protobuf::Descriptor& message);
  Status append(std::uint16_t channel, std::string_view topic, Tick tick,
                std::uint64_t publish_time_ns, BytesView message);

  std::unique_ptr<McapWriter> mcap_;
  JournalTimes times_;
  ContentSum sum_;
  std::map<std::string, std::uint16_t> schema_ids_;  // by full name
  std::array<std::uint16_t, kJournalTopicCount> channel_ids_{};
  std::array<std::uint16_t, kMaxTools> tool_channel_ids_{};  // 0: not yet
  Bytes scratch_;
};

}  // namespace trocar::journal
