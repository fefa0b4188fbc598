#include "tests/recording/recorded_simulation.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "common/journal/session_journal.h"
#include "common/journal/session_journal_writer.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/session/recording/recorder.h"
#include "server/tissue/step/simulation.h"
#include "tests/support/files.h"

namespace trocar::recording::testing {
namespace {

// Presses, grasps or cuts at the top, along x, for ever anew.
Pose pose_of(std::uint8_t hand, Tick tick, const Vec3f& top, tool::Verb& verb) {
  const float t = static_cast<float>(tick % 800) * 1e-3f;
  const float along = -0.03f + 0.08f * t;
  const float depth = std::min(0.02f, 0.1f * t - 0.005f);
  constexpr tool::Verb kVerbs[] = {tool::Verb::Push, tool::Verb::Grasp, tool::Verb::Cut};
  verb = t < 0.7f ? kVerbs[hand] : tool::Verb::None;
  const Vec3f beside{hand == 1 ? 0.05f : along, hand == 1 ? 0.03f * t : -depth,
                     0.02f * static_cast<float>(2 - hand)};
  return {top + beside, rotation_from_z({0, 1, 0})};
}

// The hand of the first tool has felt what its clock says, in micronewtons along y.
wire::HandReport report_until(std::uint64_t time_us) {
  wire::HandReport report;
  for (std::uint64_t i = 0; i < wire::HandReport::kMostMoments; ++i) {
    const auto moment_us = time_us - 16'000 * (wire::HandReport::kMostMoments - 1 - i);
    const auto felt_n = 1e-6f * static_cast<float>(moment_us - kClientStart_us);
    report.moments.push_back({.time_us = moment_us,
                              .hand_force_n = {0, felt_n, 0},
                              .model_force_n = {0, 0, 2 * felt_n},
                              .answer_age_us = 5000,
                              .limits = 1u << 6});
  }
  report.echo_delay_s = 0.030f;
  report.rate_hz = 1000;
  report.force_scale = 0.5f;
  report.device = "a hand, \"made up\"";
  return report;
}

}  // namespace

void record_simulation(const std::string& path, Tick dropped_at, const step::SceneRules& rules) {
  Beginning beginning;
  beginning.bleeding = rules.bleeding;
  beginning.threads = rules.threads;
  step::Simulation simulation(*catalogue::make_liver(800), 1, rules);
  auto recorder = Recorder::create(path, simulation.organ(), simulation.layout(), beginning);
  ASSERT_TRUE(recorder.ok()) << recorder.error().message;
  Vec3f top{0, -1, 0};
  for (const auto& p : simulation.organ().mesh.rest_positions)
    if (static_cast<float>(p.y) > top.y) top = to_float(p);

  std::vector<participants::Participant> present;
  hands::TickInputs inputs;
  for (std::uint8_t hand = 0; hand < 3; ++hand) {
    tool::ToolShape shape{.radius_m = 0.004f, .length_m = 0.2f, .reach_m = 0.02f, .edge_m = 0.06f};
    present.push_back(
        {{hand}, "Hand " + std::to_string(hand), participants::Role::Surgeon, {shape}});
    inputs.joins.push_back({.slot = {hand}, .tool_count = 1, .shapes = {shape, {}}});
  }
  (*recorder)->record_participants(present, 0);

  Bytes state;
  simulation.write_snapshot(state);
  auto snapshot = std::make_shared<const Bytes>(state);
  Tick snapshot_tick = 0;
  std::vector<step::TickRecord> records;
  for (Tick tick = 1; tick <= kRecordedTicks; ++tick) {
    for (std::uint8_t hand = 0; tick % 4 == 1 && hand < 3; ++hand) {
      tool::Verb verb = tool::Verb::None;
      const Pose pose = pose_of(hand, tick, top, verb);
      const std::uint64_t time_us = hand == 0 ? kClientStart_us + 1000 * tick : 0;
      inputs.samples.push_back({tool_slot({hand}, 0), {pose, verb}, time_us});
    }
    const auto& done = simulation.tick(inputs, {});
    records.push_back({tick, {}, inputs, done.state_hash});
    inputs.clear();
    if (std::ranges::find(kSnapshotTicks, tick) != std::end(kSnapshotTicks)) {
      state.clear();
      simulation.write_snapshot(state);
      snapshot = std::make_shared<const Bytes>(state);
      snapshot_tick = tick;
    }
    auto frame = simulation.pop_frame();
    if (!frame) continue;
    frame->records = std::exchange(records, {});
    frame->snapshot = std::exchange(snapshot, nullptr);
    frame->snapshot_tick = snapshot_tick;
    if (tick == dropped_at) {
      frame->snapshot = std::make_shared<const Bytes>(Recorder::kQueueBytes + 1);
      frame->snapshot_tick = tick;
    }
    const auto echo_us = frame->tools.front().touch.echo_time_us;
    (*recorder)->record_frame(frame);
    const bool has_report = tick >= kFirstReportTick && tick % (8 * kTicksPerFrame) == 0;
    if (has_report)
      (*recorder)->record_hand({.tool = tool_slot({0}, 0),
                                .report = report_until(kClientStart_us + 1000 * tick),
                                .tick = tick,
                                .echo_time_us = echo_us});
  }
  const Status closed = (*recorder)->close();
  ASSERT_TRUE(closed.ok()) << closed.error().message;
  ASSERT_EQ((*recorder)->state().frames_missing, dropped_at > 0 ? 1u : 0u);
}

const std::string& recorded_simulation() {
  static const trocar::testing::TemporaryFolder folder;
  static const std::string path = [] {
    auto file = folder.file("recorded.mcap");
    record_simulation(file);
    return file;
  }();
  return path;
}

void copy_journal(const std::string& from, const std::string& to, const Edit& edit,
                  std::uint32_t sim_version) {
  auto journal = journal::SessionJournal::open(from);
  ASSERT_TRUE(journal.ok()) << journal.error().message;
  const auto& info = (*journal)->info();
  auto writer =
      journal::SessionJournalWriter::create(to, {.start_utc_ns = info.start_utc_ns,
                                                 .sim_version = sim_version,
                                                 .organ_name = info.organ_name,
                                                 .organ_hash = info.organ_hash,
                                                 .has_external_loads = info.has_external_loads,
                                                 .starts_from_snapshot = info.starts_from_snapshot,
                                                 .has_implicit_strain = info.has_implicit_strain});
  ASSERT_TRUE(writer.ok()) << writer.error().message;
  const auto read = (*journal)->read_all([&](std::string_view topic, Tick tick, BytesView bytes) {
    const auto known = journal::topic_of(topic);
    std::unique_ptr<google::protobuf::Message> message;
    if (known)
      message.reset(google::protobuf::MessageFactory::generated_factory()
                        ->GetPrototype(&journal::topic_message(*known))
                        ->New());
    else
      message = std::make_unique<proto::ToolState>();
    EXPECT_TRUE(message->ParseFromArray(bytes.data(), static_cast<int>(bytes.size())));
    if (!edit(topic, *message)) return true;
    Status written;
    if (known) {
      written = (*writer)->write(*known, tick, info.start_utc_ns, *message);
    } else {
      const auto& tool = static_cast<const proto::ToolState&>(*message);
      written = (*writer)->write_tool({static_cast<std::uint8_t>(tool.tool())}, tick,
                                      info.start_utc_ns, tool);
    }
    EXPECT_TRUE(written.ok());
    return true;
  });
  ASSERT_EQ(read.damaged_chunks, 0u);
  ASSERT_TRUE((*writer)->close().ok());
}

}  // namespace trocar::recording::testing
