// Two hands want the same tissue: refused by name, granted when the holder falls silent or leaves.

#include <gtest/gtest.h>

#include <csignal>
#include <fstream>

#include "common/journal/session_journal.h"
#include "tests/e2e/programs.h"

namespace trocar::e2e {
namespace {

std::filesystem::path write_grasp_script(const std::filesystem::path& folder) {
  const auto file = folder / "hold.toml";
  std::ofstream(file) << R"([[tool]]
reach_mm = 16
anchor = [0, -1, 0.9]
anchor_on = "extreme"

[[tool.key]]
time_s = 0
position_mm = [0, 0, 0]
shaft = [-0.6, -0.25, 1]
verb = "grasp"

[[tool.key]]
time_s = 60
position_mm = [0, 0, 0]
)";
  return file;
}

std::vector<proto::ClaimEvent> claim_events(const std::filesystem::path& file) {
  std::vector<proto::ClaimEvent> events;
  auto journal = journal::SessionJournal::open(file.string());
  if (!journal.ok()) return events;  // nothing is recorded yet
  const auto read = (*journal)->read_claims(0, (*journal)->info().last_tick,
                                            [&](Tick, const proto::ClaimLog& log) {
                                              for (const auto& event : log.event())
                                                events.push_back(event);
                                              return true;
                                            });
  EXPECT_TRUE(read.ok());
  return events;
}

// Tool slots: Anna joins first (0), Ben second (2).
class GraspRules : public ::testing::Test {
 protected:
  // Runs Anna and Ben on the same spot; `to_anna` is sent to Anna once Ben was refused.
  std::vector<proto::ClaimEvent> run(int to_anna) {
    Session session("liver");
    const auto script = write_grasp_script(session.folder);
    const auto wait_for = [&](std::uint32_t tool, proto::ClaimOutcome outcome) {
      EXPECT_TRUE(wait_until(
          [&] { return find(claim_events(session.journal), tool, outcome) != nullptr; }, 60))
          << "tool " << tool << ", " << proto::ClaimOutcome_Name(outcome);
    };
    auto anna = session.hand("Anna", script);
    wait_for(0, proto::CLAIM_GRANTED);
    auto ben = session.hand("Ben", script);
    wait_for(2, proto::CLAIM_REFUSED_HELD);
    anna.signal(to_anna);
    wait_for(2, proto::CLAIM_GRANTED);
    session.server().signal(SIGTERM);
    EXPECT_EQ(session.server().wait(30), 0);
    if (to_anna == SIGSTOP) anna.signal(SIGKILL);
    return claim_events(session.journal);
  }
  static const proto::ClaimEvent* find(const std::vector<proto::ClaimEvent>& events,
                                       std::uint32_t tool, proto::ClaimOutcome outcome) {
    for (const auto& event : events)
      if (event.tool() == tool && event.outcome() == outcome) return &event;
    return nullptr;
  }
};

TEST_F(GraspRules, AGraspOnAHeldNodeIsRefusedByNameAndGrantedWhenTheHolderLeaves) {
  const auto events = run(SIGTERM);
  ASSERT_NE(find(events, 0, proto::CLAIM_GRANTED), nullptr);
  const auto* refused = find(events, 2, proto::CLAIM_REFUSED_HELD);
  ASSERT_NE(refused, nullptr);
  EXPECT_EQ(refused->holder_name(), "Anna");
  EXPECT_NE(refused->text().find("Anna"), std::string::npos);
  EXPECT_NE(find(events, 2, proto::CLAIM_GRANTED), nullptr);
  EXPECT_EQ(find(events, 0, proto::CLAIM_TAKEN_OVER), nullptr)
      << "she left, nobody took it from her";
}

TEST_F(GraspRules, AHolderThatFallsSilentIsTakenOverAfterItsLease) {
  const auto events = run(SIGSTOP);
  const auto* refused = find(events, 2, proto::CLAIM_REFUSED_HELD);
  const auto* taken = find(events, 0, proto::CLAIM_TAKEN_OVER);
  const auto* granted = find(events, 2, proto::CLAIM_GRANTED);
  ASSERT_NE(refused, nullptr);
  ASSERT_NE(taken, nullptr);
  ASSERT_NE(granted, nullptr);
  EXPECT_EQ(taken->tick(), granted->tick());
  EXPECT_EQ(taken->holder_name(), "Ben");
  EXPECT_GT(granted->tick(), refused->tick() + 250);
}

}  // namespace
}  // namespace trocar::e2e
