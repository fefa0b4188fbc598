// A recorded hand in a session of its own, and an expert's force in a learner's hand.

#include <gtest/gtest.h>

#include <cmath>
#include <csignal>
#include <fstream>
#include <sstream>

#include "client/replay/recorded_hand.h"
#include "tests/e2e/programs.h"

namespace trocar::e2e {
namespace {

namespace fs = std::filesystem;

// Comes to the front of the organ, presses 8 mm, slides, and leaves.
fs::path write_press(const fs::path& folder) {
  const auto file = folder / "press.toml";
  std::ofstream(file) << R"([[tool]]
radius_mm = 6
anchor = [0, 0, 1]
anchor_frame = "normal"

[[tool.key]]
time_s = 0
position_mm = [0, 0, 30]
verb = "push"

[[tool.key]]
time_s = 1
position_mm = [0, 0, 3]

[[tool.key]]
time_s = 2
position_mm = [0, 0, -8]

[[tool.key]]
time_s = 4
position_mm = [8, 0, -8]

[[tool.key]]
time_s = 5
position_mm = [8, 0, 30]
)";
  return file;
}

struct TraceRow {
  double time_us = 0;
  Vec3d tip_m, force_n, recorded_n;
};
std::vector<TraceRow> read_trace(const fs::path& file) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  std::vector<TraceRow> rows;
  while (std::getline(in, line)) {
    for (char& c : line)
      if (c == ',') c = ' ';
    std::istringstream numbers(line);
    double tool = 0;
    TraceRow row;
    numbers >> tool >> row.time_us >> row.tip_m.x >> row.tip_m.y >> row.tip_m.z >> row.force_n.x >>
        row.force_n.y >> row.force_n.z >> row.recorded_n.x >> row.recorded_n.y >> row.recorded_n.z;
    rows.push_back(row);
  }
  return rows;
}

fs::path record_press() {
  Session session("liver", at_pace(1, {"--seconds", "9"}));
  auto anna = session.hand("Anna", write_press(session.folder));
  EXPECT_EQ(session.server().wait(120), 0) << read_text(session.folder / "server.log");
  EXPECT_EQ(anna.wait(20), 0) << read_text(session.folder / "Anna.log");
  const auto kept = session.folder / "expert.mcap";
  fs::rename(session.journal, kept);
  fs::remove(session.folder / "ready");  // another session may follow in this folder
  return kept;
}

// The recording of Anna's press, of which there is one.
const fs::path& recorded_press() {
  static const fs::path file = record_press();
  return file;
}

double greatest_force_n(const replay::RecordedHand& hand) {
  double greatest_n = 0;
  for (const auto& felt : hand.felt)
    greatest_n = std::max(greatest_n, static_cast<double>(length(felt.force_n)));
  return greatest_n;
}

TEST(RecordedHandInUse, DoesInAnotherSessionWhatItDid) {
  const auto& expert = recorded_press();
  const auto recorded = replay::read_recorded_hand(expert.string(), "Anna", 0);
  ASSERT_TRUE(recorded.ok()) << recorded.error().message;
  ASSERT_GT(greatest_force_n(*recorded), 0.2);

  Session session("liver");
  auto robot =
      session.client("Robot", "surgeon",
                     {"--device", "journal:" + expert.string() + ",name=Anna", "--seconds", "7"});
  EXPECT_EQ(robot.wait(60), 0) << read_text(session.folder / "Robot.log");
  session.server().signal(SIGTERM);
  ASSERT_EQ(session.server().wait(30), 0);
  const auto again = replay::read_recorded_hand(session.journal.string(), "Robot", 0);
  ASSERT_TRUE(again.ok()) << again.error().message;
  EXPECT_EQ(again->shape, recorded->shape);
  // The same way, whenever it began: each sample lies on the recorded one's way.
  double farthest_m = 0;
  for (const auto& sample : again->samples) {
    double nearest_m = 1;
    for (const auto& known : recorded->samples)
      nearest_m = std::min(nearest_m, static_cast<double>(length(sample.world_from_tool.position -
                                                                 known.world_from_tool.position)));
    farthest_m = std::max(farthest_m, nearest_m);
  }
  EXPECT_LT(farthest_m, 0.001);
  EXPECT_GT(again->samples.size(), 300u);
  EXPECT_NEAR(greatest_force_n(*again), greatest_force_n(*recorded),
              0.1 * greatest_force_n(*recorded));
}

TEST(RecordedHandInUse, AHandThatIsNotThereIsAnErrorInOneLine) {
  const auto& expert = recorded_press();
  const auto folder = test_folder();
  Program client("trocar-client",
                 {"--no-render", "--device", "journal:" + expert.string() + ",name=Ben"},
                 folder / "client.log");
  EXPECT_EQ(client.wait(20), 2);
  EXPECT_NE(read_text(folder / "client.log").find("has no Ben, choose one of: Anna"),
            std::string::npos)
      << read_text(folder / "client.log");
}

TEST(RecordedHandInUse, ALearnerFeelsWhatTheExpertFelt) {
  const auto& expert = recorded_press();
  const auto recorded = replay::read_recorded_hand(expert.string(), "Anna", 0);
  ASSERT_TRUE(recorded.ok()) << recorded.error().message;
  const auto folder = test_folder();
  Program client("trocar-client",
                 {"--no-render", "--replay", expert.string(), "--device", "simulated:still",
                  "--feel", "Anna", "--feel-pull", "0", "--seconds", "8", "--hand-trace",
                  (folder / "trace.csv").string(), "--summary", (folder / "replay.json").string()},
                 folder / "client.log");
  ASSERT_EQ(client.wait(60), 0) << read_text(folder / "client.log");
  const auto rows = read_trace(folder / "trace.csv");
  ASSERT_GT(rows.size(), 4000u);
  double greatest_n = 0, greatest_step_n = 0, greatest_error_n = 0;
  for (std::size_t i = 1; i < rows.size(); ++i) {
    greatest_n = std::max(greatest_n, length(rows[i].force_n));
    greatest_step_n = std::max(greatest_step_n, length(rows[i].force_n - rows[i - 1].force_n));
    // From one second on it is past its ramp.
    if (rows[i].time_us > rows[0].time_us + 1e6)
      greatest_error_n = std::max(greatest_error_n, length(rows[i].force_n - rows[i].recorded_n));
  }
  EXPECT_NEAR(greatest_n, greatest_force_n(*recorded), 0.02);
  EXPECT_LE(greatest_step_n, 0.3) << "the safety chain";
  EXPECT_LE(greatest_error_n, 0.02);
  EXPECT_GT(json_number(read_text(folder / "replay.json"), "largest_force_n"), 0.2);
}

}  // namespace
}  // namespace trocar::e2e
