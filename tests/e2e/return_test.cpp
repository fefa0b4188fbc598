// A network that fails for some seconds: the client comes back by itself, others notice a silent
// hand, and in the end everybody shows the same tissue.

#include <gtest/gtest.h>

#include <csignal>
#include <fstream>

#include "common/journal/session_journal.h"
#include "tests/e2e/programs.h"

namespace trocar::e2e {
namespace {

namespace fs = std::filesystem;

// A grasp of the lower edge that is held for a minute and drawn to and fro.
fs::path write_drawing_script(const fs::path& folder) {
  const auto file = folder / "hold.toml";
  std::ofstream out(file);
  out << R"([[tool]]
reach_mm = 16
anchor = [0, -1, 0.9]
anchor_on = "extreme"

[[tool.key]]
time_s = 0
position_mm = [0, 0, 0]
shaft = [-0.6, -0.25, 1]
verb = "grasp"
)";
  for (int i = 1; i < 30; ++i)
    out << "\n[[tool.key]]\ntime_s = " << 2 * i << "\nposition_mm = [0, " << (i % 2) * 8 << ", "
        << (i % 2) * 6 << "]\n";
  return file;
}

class Return : public ::testing::Test {
 protected:
  // Anna's hand goes through a network that is cut from second 5 to 10 of its life.
  Program start_network() {
    Program network(
        "trocar-impair",
        {"--to", session_.address(), "--listen", "127.0.0.1:0", "--cut-stream", "5:5",
         "--block-datagrams", "5:5", "--ready-file", (session_.folder / "network").string()},
        session_.folder / "network.log");
    EXPECT_TRUE(wait_for_file(session_.folder / "network", 20));
    return network;
  }
  Program start_anna() {
    const auto log = session_.folder / "server.log";
    EXPECT_TRUE(
        wait_until([&] { return read_text(log).find("observer ") != std::string::npos; }, 20));
    return Program("trocar-client",
                   {"--no-render", "--name", "Anna", "--script", script_.string(), "--join",
                    find_invitation(log, "surgeon").code, "--server",
                    ready_address(session_.folder / "network"), "--summary",
                    (session_.folder / "Anna.json").string()},
                   session_.folder / "Anna.log");
  }
  bool server_says(const std::string& text, double seconds) const {
    return wait_until(
        [&] { return read_text(session_.folder / "server.log").find(text) != std::string::npos; },
        seconds);
  }
  std::vector<proto::ClaimEvent> events(std::uint32_t tool, proto::ClaimOutcome outcome) const {
    std::vector<proto::ClaimEvent> found;
    auto journal = journal::SessionJournal::open(session_.journal.string());
    if (!journal.ok()) return found;  // nothing is recorded yet
    const auto read = (*journal)->read_claims(
        0, (*journal)->info().last_tick, [&](Tick, const proto::ClaimLog& log) {
          for (const auto& event : log.event())
            if (event.tool() == tool && event.outcome() == outcome) found.push_back(event);
          return true;
        });
    EXPECT_TRUE(read.ok());
    return found;
  }
  bool wait_for_events(std::size_t count, std::uint32_t tool, proto::ClaimOutcome outcome) const {
    return wait_until([&] { return events(tool, outcome).size() >= count; }, 60);
  }
  void expect_a_good_end(std::size_t participants) {
    session_.server().signal(SIGTERM);
    ASSERT_EQ(session_.server().wait(30), 0);
    const auto server = read_text(session_.folder / "server.json");
    EXPECT_EQ(json_value(server, "all_replicas_equal"), "true") << server;
    EXPECT_GE(json_number(server, "connections_lost"), 1);
    EXPECT_GE(json_number(server, "returned"), 1);
    EXPECT_EQ(json_number(server, "sessions"), static_cast<double>(participants));
    Program verify("trocar-journal", {"verify", session_.journal.string()},
                   session_.folder / "verify.log");
    EXPECT_EQ(verify.wait(200), 0) << read_text(session_.folder / "verify.log");
  }

  Session session_{"lattice"};
  fs::path script_ = write_drawing_script(session_.folder);
};

TEST_F(Return, AConnectionThatIsCutForSecondsComesBackToItsPlaceAndItsGrasp) {
  auto watcher = session_.client("Watcher", "observer");
  auto network = start_network();
  auto anna = start_anna();
  ASSERT_TRUE(wait_for_events(1, 0, proto::CLAIM_GRANTED))
      << read_text(session_.folder / "Anna.log");
  ASSERT_TRUE(wait_for_events(1, 0, proto::CLAIM_EXPIRED)) << "silent for two seconds";
  ASSERT_TRUE(server_says("Anna (surgeon) is back", 60));
  ASSERT_TRUE(wait_for_events(2, 0, proto::CLAIM_GRANTED)) << "the key was held all the time";
  const auto granted = events(0, proto::CLAIM_GRANTED);
  EXPECT_GT(granted[1].tick(), events(0, proto::CLAIM_EXPIRED)[0].tick());
  ASSERT_TRUE(session_.wait_for_tick(granted[1].tick() + 1000));
  expect_a_good_end(2);
  EXPECT_EQ(anna.wait(20), 0);
  EXPECT_EQ(watcher.wait(20), 0);
  const auto summary = session_.summary_of("Anna");
  EXPECT_GE(json_number(summary, "returns"), 1) << summary;
  EXPECT_GT(json_number(summary, "longest_absence_seconds"), 1);
  EXPECT_LT(json_number(summary, "longest_absence_seconds"), 15);
  EXPECT_EQ(json_number(summary, "crc_mismatches"), 0);
  EXPECT_EQ(json_value(summary, "equal"), "true");
}

TEST_F(Return, WhatSomebodyElseHasTakenMeanwhileStaysHis) {
  auto network = start_network();
  auto anna = start_anna();
  ASSERT_TRUE(wait_for_events(1, 0, proto::CLAIM_GRANTED))
      << read_text(session_.folder / "Anna.log");
  auto ben = session_.hand("Ben", script_);
  ASSERT_TRUE(wait_for_events(1, 0, proto::CLAIM_TAKEN_OVER));
  ASSERT_TRUE(server_says("Anna (surgeon) is back", 60));
  ASSERT_TRUE(wait_for_events(1, 0, proto::CLAIM_REFUSED_HELD));
  const auto refused = events(0, proto::CLAIM_REFUSED_HELD)[0];
  EXPECT_EQ(refused.holder_name(), "Ben");
  ASSERT_TRUE(session_.wait_for_tick(refused.tick() + 1000));
  EXPECT_TRUE(events(2, proto::CLAIM_TAKEN_OVER).empty());
  EXPECT_EQ(events(0, proto::CLAIM_GRANTED).size(), 1u);
  expect_a_good_end(2);
  EXPECT_EQ(anna.wait(20), 0);
  EXPECT_EQ(ben.wait(20), 0);
}

}  // namespace
}  // namespace trocar::e2e
