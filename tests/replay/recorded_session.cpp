#include "tests/replay/recorded_session.h"

#include "common/base/assert.h"
#include "common/wire/surface_codec.h"
#include "common/wire/surface_messages.h"
#include "proto/organ.pb.h"
#include "tests/client/synthetic_source.h"
#include "tests/support/surface_edits.h"

namespace trocar::replay::testing {
namespace {

using journal::JournalTopic;

struct Collector final : replica::MessageSink {
  void on_message(const proto::Envelope& message, std::uint64_t, std::size_t) override {
    messages.push_back(message);
  }
  std::vector<proto::Envelope> messages;
};

class Recorder {
 public:
  Recorder(const std::string& path, const RecordingOptions& options) : options_(options) {
    journal::SessionDescription session;
    session.start_utc_ns = kStartUtc;
    session.protocol_major = options.protocol_major;
    session.organ_name = "blob";
    session.organ_hash = 0x0123456789abcdefu;
    auto created = journal::SessionJournalWriter::create(path, session, options.container);
    TROCAR_ASSERT(created.ok());
    writer_ = std::move(*created);
  }

  void write(JournalTopic topic, Frame frame, const google::protobuf::Message& message) {
    Bytes bytes(message.ByteSizeLong());
    message.SerializeToArray(bytes.data(), static_cast<int>(bytes.size()));
    if (options_.tamper && !options_.tamper(topic, frame, bytes)) return;
    const Tick tick = frame * kTicksPerFrame;
    const Status written = writer_->write(topic, tick, kStartUtc + tick * kTickNanoseconds, bytes);
    TROCAR_ASSERT(written.ok());
  }
  void write_participants(Frame frame, int count) {
    proto::Participants list;
    for (int i = 0; i < count; ++i) {
      auto& participant = *list.add_participant();
      participant.set_slot(i == 0 ? 0 : kMaxHands);  // the second one watches
      participant.set_name(i == 0 ? "Mira" : "Jonas");
      participant.set_role(i == 0 ? proto::ROLE_SURGEON : proto::ROLE_OBSERVER);
    }
    write(JournalTopic::Participants, frame, list);
  }
  void write_claim(Frame frame) {
    proto::ClaimLog log;
    auto& event = *log.add_event();
    event.set_tick(frame * kTicksPerFrame - 3);
    event.set_tool(2);
    event.set_verb(proto::VERB_GRASP);
    event.set_outcome(proto::CLAIM_REFUSED_HELD);
    event.set_text("grasp refused: Mira holds this tissue");
    write(JournalTopic::Claims, frame, log);
  }
  void write_stage(Frame frame, bool is_over) {
    proto::LessonRecord record;
    auto& stage = *record.mutable_stage();
    stage.set_title("Find the lump");
    stage.set_stages(1);
    stage.set_name("Search");
    stage.set_begin_tick(frame * kTicksPerFrame);
    stage.set_is_over(is_over);
    write(JournalTopic::Lesson, frame, record);
  }
  void finish() {
    const Status ended = options_.is_finished ? writer_->close() : writer_->flush();
    TROCAR_ASSERT(ended.ok());
  }

 private:
  const RecordingOptions& options_;
  std::unique_ptr<journal::SessionJournalWriter> writer_;
};

Truth::Triangles triangles_of(const wire::SurfaceLayout& layout) {
  Truth::Triangles triangles(layout.triangles.size());
  for (std::size_t i = 0; i < triangles.size(); ++i)
    for (std::size_t k = 0; k < 3 && layout.has_triangle(TriangleIndex(i)); ++k)
      triangles[i][k] = layout.triangles[i][k].value;
  return triangles;
}

}  // namespace

Truth record_session(const std::string& path, const RecordingOptions& options) {
  Recorder recorder(path, options);
  trocar::testing::SyntheticSource session(trocar::testing::make_blob_layout(8, 12, 0.08), "blob");
  Collector start;
  session.queue_start();
  session.poll(start);
  proto::SurfaceTopology topology;
  for (const auto& message : start.messages)
    if (message.has_surface_topology()) topology = message.surface_topology();
  if (options.has_fine_surface) {
    proto::Organ organ;
    for (const int step : {0, 0, 0, 9, 0, 0, 0, 9, 0})
      organ.mutable_fine_surface()->add_position_step(step);
    for (const int step : {0, 1, 1}) organ.mutable_fine_surface()->add_corner_step(step);
    recorder.write(JournalTopic::Organ, 0, organ);
  }
  recorder.write(JournalTopic::Topology, 0, topology);
  recorder.write_participants(0, 1);

  trocar::testing::Random random(9);
  Truth truth;
  truth.crc.push_back(0);
  truth.epoch.push_back(1);
  truth.triangles.emplace_back();
  for (Frame frame = 1; frame <= options.frames; ++frame) {
    const bool is_cut = frame == options.cut_at;
    if (is_cut) {
      topology.set_epoch(2);
      recorder.write(JournalTopic::Topology, frame, topology);
    }
    if (frame == options.join_at) recorder.write_participants(frame, 2);
    Collector now;
    if (options.cut_every > 0 && frame % options.cut_every == 0)
      session.queue_change(trocar::testing::random_change(session.layout(), random));
    session.queue_frame();
    session.poll(now);
    for (auto& message : now.messages) {
      if (message.has_surface_change()) {
        topology.Clear();
        wire::write(session.layout(), "blob", topology);
        recorder.write(JournalTopic::TopologyChange, frame, message.surface_change());
      }
      if (message.has_frame_state())
        recorder.write(JournalTopic::FrameState, frame, message.frame_state());
      if (!message.has_surface_frame()) continue;
      proto::SurfaceFrame& surface = *message.mutable_surface_frame();
      surface.set_epoch(topology.epoch());
      // The state may come before the surface, and the key before the delta or after it.
      const bool has_key = frame % kFramesPerKey == 1 || is_cut;
      if (!surface.is_keyframe() && !is_cut)
        recorder.write(JournalTopic::SurfaceDelta, frame, surface);
      if (!has_key) continue;
      Bytes payload;
      wire::encode_keyframe(session.surface(), payload);
      if (options.cut_every > 0 && topology.epoch() > 1)
        recorder.write(JournalTopic::Topology, frame, topology);
      surface.set_is_keyframe(true);
      surface.clear_base_frame();
      surface.set_payload(payload.data(), payload.size());
      recorder.write(JournalTopic::SurfaceKey, frame, surface);
    }
    if (frame == options.claim_at) recorder.write_claim(frame);
    if (options.stage_at > 0 && frame == options.stage_at) recorder.write_stage(frame, false);
    if (options.stage_at > 0 && frame == options.stage_at + 100) recorder.write_stage(frame, true);
    truth.crc.push_back(wire::surface_crc(session.surface()));
    truth.epoch.push_back(topology.epoch());
    truth.triangles.push_back(triangles_of(session.layout()));
  }
  truth.last_frame = options.frames;
  recorder.finish();
  return truth;
}

Player::Player(const std::string& path) {
  auto result = ReplaySource::open(path, [this] { return now_ns; });
  if (result.ok())
    source = std::move(*result);
  else
    opened = result.error();
}

void Player::step(std::uint64_t milliseconds) {
  now_ns += milliseconds * 1'000'000;
  source->poll(replica);
}

void Player::expect_truth(const Truth& truth) const {
  expect_honest(truth);
  ASSERT_EQ(source->state(), replica::SourceState::Live) << source->close_reason().text;
  ASSERT_EQ(replica.sync_state(), replica::SyncState::InStep);
  ASSERT_NE(replica.newest(), nullptr);
  ASSERT_EQ(replica.newest()->frame, source->position() / kTicksPerFrame);
  ASSERT_TRUE(replica.newest()->has_state);
}

void Player::expect_honest(const Truth& truth) const {
  ASSERT_TRUE(replica.fault().ok()) << replica.fault().error().message;
  if (replica.newest() == nullptr) return;
  const Frame frame = replica.newest()->frame;
  ASSERT_LT(frame, truth.crc.size());
  ASSERT_EQ(wire::surface_crc(replica.newest()->surface), truth.crc[frame]) << "frame " << frame;
  ASSERT_EQ(replica.topology().epoch, truth.epoch[frame]) << "frame " << frame;
  ASSERT_EQ(replica.topology().triangles, truth.triangles[frame]) << "frame " << frame;
}

}  // namespace trocar::replay::testing
