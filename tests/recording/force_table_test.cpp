// Forces of a recording as a table: what the tissue did beside what a hand felt at the same pose.

#include "server/session/recording/force_table.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <sstream>

#include "common/journal/session_journal.h"
#include "server/session/recording/hand_moments.h"
#include "server/session/recording/verify.h"
#include "tests/recording/recorded_simulation.h"
#include "tests/support/files.h"
#include "tests/support/program_fixture.h"

namespace trocar::recording::testing {
namespace {

using trocar::testing::TemporaryFolder;

// Cells by the names of their columns; quoted ones may have commas.
using Row = std::map<std::string, std::string>;

std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells(1);
  bool is_quoted = false;
  for (const char c : line) {
    if (c == '"')
      is_quoted = !is_quoted;
    else if (c == ',' && !is_quoted)
      cells.emplace_back();
    else
      cells.back() += c;
  }
  return cells;
}

std::vector<Row> rows_of(const std::string& text) {
  std::istringstream in(text);
  std::string line;
  std::getline(in, line);
  const auto names = cells_of(line);
  std::vector<Row> rows;
  while (std::getline(in, line)) {
    const auto cells = cells_of(line);
    EXPECT_EQ(cells.size(), names.size()) << line;
    auto& row = rows.emplace_back();
    for (std::size_t i = 0; i < std::min(cells.size(), names.size()); ++i) row[names[i]] = cells[i];
  }
  return rows;
}

class ForceTable : public trocar::testing::ProgramFixture {
 protected:
  ForceTable() : ProgramFixture("trocar-journal") {}
};

TEST_F(ForceTable, HasARowForEachToolAndFrameWithWhatTheHandFeltAtThatPose) {
  ASSERT_EQ(run({"export", recorded_simulation(), "--forces", at("forces.csv")}), 0) << log();
  EXPECT_NE(log().find("450 rows"), std::string::npos) << log();
  const auto rows = rows_of(read(at("forces.csv")));
  ASSERT_EQ(rows.size(), 3 * kRecordedTicks / kTicksPerFrame);
  auto journal = journal::SessionJournal::open(recorded_simulation());
  ASSERT_TRUE(journal.ok());
  std::map<Tick, std::uint64_t> echo_us;
  ASSERT_TRUE((*journal)
                  ->read_hands(0, kRecordedTicks,
                               [&](Tick, const proto::HandLog& log) {
                                 echo_us[log.tick()] = log.echo_time_us();
                                 return true;
                               })
                  .ok());
  EXPECT_EQ(echo_us.size(), (kRecordedTicks - kFirstReportTick) / 128 + 1);
  std::size_t felt = 0, exact = 0;
  for (const auto& row : rows) {
    const auto tick = static_cast<Tick>(std::stoull(row.at("tick")));
    EXPECT_NEAR(std::stod(row.at("time_s")), 1e-3 * static_cast<double>(tick), 1e-9);
    EXPECT_EQ(row.at("name"), "Hand " + std::to_string(std::stoi(row.at("tool")) / 2));
    EXPECT_FALSE(row.at("server_y_n").empty());
    if (row.at("tool") != "0") {
      EXPECT_EQ(row.at("hand_y_n") + row.at("limits") + row.at("device"), "");
      continue;
    }
    if (row.at("hand_y_n").empty()) continue;
    ++felt;
    EXPECT_EQ(row.at("limits"), "slew");
    EXPECT_EQ(row.at("device"), "a hand, made up");
    EXPECT_EQ(row.at("force_scale"), "0.5");
    const double hand_n = std::stod(row.at("hand_y_n"));
    EXPECT_NEAR(std::stod(row.at("model_z_n")), 2 * hand_n, 3e-4);
    if (!echo_us.contains(tick)) continue;
    ++exact;
    EXPECT_NEAR(hand_n, 1e-6 * static_cast<double>(echo_us[tick] - kClientStart_us), 1e-4);
  }
  EXPECT_GT(felt, (kRecordedTicks - kFirstReportTick) / kTicksPerFrame);
  EXPECT_EQ(exact, echo_us.size());
}

TEST_F(ForceTable, AReportOutOfItsRangesIsCountedAndKeepsARecordingFromBeingVerified) {
  EXPECT_EQ(verify_journal(recorded_simulation())->verdict(), Verdict::Verified)
      << "reports themselves do not disturb";
  bool is_changed = false;
  copy_journal(recorded_simulation(), at("copy.mcap"), [&](auto topic, auto& message) {
    if (topic == "/hands" && !std::exchange(is_changed, true))
      static_cast<proto::HandLog&>(message).mutable_report()->set_rate_hz(-1);
    return true;
  });
  ASSERT_TRUE(is_changed);
  const auto report = verify_journal(at("copy.mcap"));
  ASSERT_TRUE(report.ok());
  EXPECT_EQ(report->verdict(), Verdict::NotVerified);
  ASSERT_EQ(report->reasons.size(), 1u);
  EXPECT_NE(report->reasons[0].find("HandReport.rate_hz"), std::string::npos) << report->reasons[0];
  const auto counts = write_force_table(at("copy.mcap"), at("forces.csv"));
  ASSERT_TRUE(counts.ok());
  EXPECT_EQ(counts->refused, 1u);
  EXPECT_GT(counts->felt, 0u);
}

TEST_F(ForceTable, SaysWhatIsWrong) {
  EXPECT_EQ(run({"export", recorded_simulation()}), 2);
  EXPECT_EQ(run({"export", at("none.mcap"), "--forces", at("forces.csv")}), 3);
  EXPECT_EQ(run({"export", recorded_simulation(), "--forces", at("no/such/folder.csv")}), 5);
  EXPECT_NE(log().find("--forces"), std::string::npos) << log();
  EXPECT_NE(log().find("No such file or directory"), std::string::npos) << log();
}

TEST_F(ForceTable, NoOutputTakesThePlaceOfARecordingOrOfTheOtherOne) {
  const auto whole = read(recorded_simulation());
  const auto file = at("a.mcap");
  std::filesystem::copy_file(recorded_simulation(), file);
  for (const char* option : {"--forces", "--lesson"}) {
    EXPECT_EQ(run({"export", file, option, file}), 2);
    expect_line(option);
    expect_line("is a recording, which would be lost");
  }
  EXPECT_EQ(read(file), whole);
  EXPECT_EQ(run({"export", file, "--forces", at("t.csv"), "--lesson", at("./t.csv")}), 2);
  expect_line("cannot hold both");
  EXPECT_FALSE(std::filesystem::exists(at("t.csv")));
}

TEST_F(ForceTable, AFullDiskIsNamedAsSuch) {
  EXPECT_EQ(run({"export", recorded_simulation(), "--forces", "/dev/full"}), 5);
  expect_line("No space left on device");
  EXPECT_EQ(run({"export", recorded_simulation(), "--forces", at("")}), 5);
  expect_line("Is a directory");
}

TEST_F(ForceTable, ALinkStaysOne) {
  write("target.csv", "old");
  std::filesystem::create_symlink(at("target.csv"), at("link.csv"));
  ASSERT_EQ(run({"export", recorded_simulation(), "--forces", at("link.csv")}), 0) << log();
  EXPECT_TRUE(std::filesystem::is_symlink(at("link.csv")));
  EXPECT_TRUE(read(at("target.csv")).starts_with("time_s,"));
}

TEST_F(ForceTable, OutputThatNobodyGetsIsNoSuccess) {
  const std::string program = TROCAR_BINARY_DIR "/trocar-journal";
  for (const char* command : {"info", "info --json", "verify --json"}) {
    const auto line = program + " " + command + " " + recorded_simulation();
    const int code = std::system((line + " >/dev/full 2>" + at("said")).c_str());
    EXPECT_EQ(WEXITSTATUS(code), 5) << command;
    const auto said = read(at("said"));
    EXPECT_NE(said.find("standard output cannot be written"), std::string::npos) << said;
    EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 1) << said;
    EXPECT_EQ(WEXITSTATUS(std::system((line + " >/dev/null").c_str())), 0) << command;
  }
}

TEST_F(ForceTable, AnOutputThatExistsIsOneCodeForAllCommands) {
  write("b.mcap", "mine");
  EXPECT_EQ(run({"anonymise", recorded_simulation(), at("b.mcap")}), 3);
  EXPECT_EQ(run({"trim", recorded_simulation(), at("b.mcap"), "--from", "0", "--to", "1"}), 3);
  expect_line("b.mcap: exists already");
  EXPECT_EQ(read(at("b.mcap")), "mine");
}

// ---- one hand's moments ----

wire::HandRecord record(std::uint64_t first_us, Tick tick, std::uint64_t echo_us) {
  wire::HandRecord record{.tool = {0}, .tick = tick, .echo_time_us = echo_us};
  for (std::uint64_t i = 0; i < 4; ++i)
    record.report.moments.push_back(
        {.time_us = first_us + 16'000 * i,
         .hand_force_n = {1e-6f * static_cast<float>(first_us + 16'000 * i), 0, 0}});
  return record;
}

TEST(HandMoments, GoWithTheClientsClockAlsoWhereTheServerIsSlow) {
  HandMoments hand;
  EXPECT_FALSE(hand.at(0));
  hand.add(record(1'000'000, 100, 1'000'000));
  hand.add(record(1'064'000, 132, 1'064'000));  // half of real time
  hand.add(record(1'128'000, 164, 1'128'000));
  for (const Tick tick : {100, 116, 132, 140}) {
    const auto felt = hand.at(tick);
    ASSERT_TRUE(felt) << tick;
    EXPECT_NEAR(felt->hand_force_n.x, 1 + 0.002 * (static_cast<double>(tick) - 100), 1e-5) << tick;
  }
  EXPECT_FALSE(hand.at(99)) << "before the first moment";
  EXPECT_FALSE(hand.at(300)) << "after the last";
}

TEST(HandMoments, HaveHolesWhereNothingCameAndDoNotMixTwoClocks) {
  HandMoments hand;
  hand.add(record(1'000'000, 100, 1'000'000));
  hand.add(record(3'000'000, 2100, 3'000'000));  // two seconds later
  EXPECT_TRUE(hand.at(110));
  EXPECT_FALSE(hand.at(1000));
  EXPECT_TRUE(hand.at(2110));
  hand.add(record(50'000, 2200, 50'000));  // another client
  const auto felt = hand.at(2210);
  ASSERT_TRUE(felt);
  EXPECT_NEAR(felt->hand_force_n.x, 0.06, 1e-5);
  EXPECT_TRUE(hand.at(2110));
  hand.add(record(114'000, 2264, 0));  // its pose is unknown
  EXPECT_TRUE(hand.at(2264)) << "the clock is carried on";
}

}  // namespace
}  // namespace trocar::recording::testing
