#pragma once

// A made-up session: 62.5 frames a second with a moving surface, as server/session/recording writes
// it.

#include <string>

#include "common/base/assert.h"
#include "common/journal/session_journal_writer.h"
#include "common/wire/surface_codec.h"

namespace trocar::journal::testing {

inline constexpr std::uint64_t kSessionStart = 1'732'200'000'000'000'000;

inline wire::QuantisedSurface sample_surface(Frame frame) {
  wire::QuantisedSurface surface(500);
  for (std::int32_t i = 0; i < 500; ++i)
    surface[i] = {(i * static_cast<std::int32_t>(frame)) / 64 % 900, -i % 40, i / 8};
  return surface;
}

inline proto::SurfaceFrame sample_frame(Frame frame, bool is_keyframe) {
  const auto surface = sample_surface(frame);
  Bytes payload;
  if (is_keyframe)
    wire::encode_keyframe(surface, payload);
  else
    wire::encode_delta(sample_surface(frame - 1), surface, payload);
  proto::SurfaceFrame message;
  message.set_frame(frame);
  message.set_tick(frame * kTicksPerFrame);
  message.set_is_keyframe(is_keyframe);
  if (!is_keyframe) message.set_base_frame(frame - 1);
  message.set_payload(payload.data(), payload.size());
  message.set_surface_crc(wire::surface_crc(surface));
  return message;
}

// Frames 0 to `frames` - 1; a keyframe every 62 frames, a snapshot every 100, a join at 50.
class SampleSession {
 public:
  explicit SampleSession(const std::string& path, std::size_t organ_bytes = 100'000) {
    SessionDescription session;
    session.start_utc_ns = kSessionStart;
    session.organ_name = "liver";
    session.organ_hash = 0x0123456789abcdefu;
    auto created = SessionJournalWriter::create(path, session);
    TROCAR_ASSERT(created.ok());
    writer_ = std::move(*created);
    proto::Organ organ;
    organ.set_name("liver");
    for (std::size_t i = 0; i < organ_bytes / 8; ++i)
      organ.add_rest_position_m(1e-4 * static_cast<double>(i % 977));
    expect(writer_->write_organ(kSessionStart, organ));
    proto::ExternalLoads loads;
    auto& pulled = *loads.add_loaded();
    pulled.add_node(13);
    pulled.add_share(1);
    auto& over_time = *pulled.mutable_over_time();
    over_time.add_time_s(0);
    for (const double force_n : {0.0, 0.5, 0.0}) over_time.add_value(force_n);
    expect(writer_->write(JournalTopic::Loads, 0, kSessionStart, loads));
    add_participants({"Mira"}, 0);
  }

  void add_participants(const std::vector<std::string>& names, Tick tick) {
    proto::Participants list;
    for (const std::string& name : names) {
      auto& participant = *list.add_participant();
      participant.set_slot(static_cast<std::uint32_t>(list.participant_size() - 1));
      participant.set_name(name);
      participant.set_role(proto::ROLE_SURGEON);
    }
    expect(writer_->write_participants(tick, now(tick), list));
  }

  void run(Frame frames) {
    for (Frame frame = 0; frame < frames; ++frame) add_frame(frame);
  }

  SessionJournalWriter& writer() { return *writer_; }

 private:
  static void expect(const Status& status) { TROCAR_ASSERT(status.ok()); }
  static std::uint64_t now(Tick tick) { return kSessionStart + tick * kTickNanoseconds + 250'000; }

  void add_frame(Frame frame) {
    const Tick tick = frame * kTicksPerFrame;
    if (frame == 50) add_participants({"Mira", "Jonas"}, tick);
    if (frame % 100 == 0) {
      proto::WorldSnapshot snapshot;
      snapshot.set_tick(tick);
      snapshot.set_state(std::string(70'000, static_cast<char>(frame)));
      expect(writer_->write_snapshot(tick, now(tick), snapshot));
    }
    proto::TickBatch batch;
    for (Tick t = frame == 0 ? 0 : tick - kTicksPerFrame + 1; t <= tick; ++t) {
      auto& record = *batch.add_record();
      record.set_tick(t);
      record.set_state_hash(t * 0x9e3779b97f4a7c15u);
    }
    expect(writer_->write_tick_batch(tick, now(tick), batch));
    if (frame % 62 == 0) expect(writer_->write_surface(tick, now(tick), sample_frame(frame, true)));
    if (frame > 0) expect(writer_->write_surface(tick, now(tick), sample_frame(frame, false)));
    proto::FrameState state;
    state.set_frame(frame);
    state.set_tick(tick);
    state.set_active_nodes(frame * 3);
    expect(writer_->write_frame_state(tick, now(tick), state));
    proto::ToolState tool;
    tool.set_tool(2);
    tool.mutable_force_n()->set_y(0.1f * static_cast<float>(frame));
    expect(writer_->write_tool({2}, tick, now(tick), tool));
  }

  std::unique_ptr<SessionJournalWriter> writer_;
};

}  // namespace trocar::journal::testing
