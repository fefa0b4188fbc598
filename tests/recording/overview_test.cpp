// The overview of a recording says what its other channels say, and takes little memory.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "common/base/ids.h"
#include "proto/journal.pb.h"
#include "proto/wire.pb.h"
#include "server/session/recording/overview.h"
#include "tests/recording/recorded_simulation.h"
#include "tests/support/files.h"

namespace trocar::recording::testing {
namespace {

using trocar::testing::TemporaryFolder;

struct Recorded {
  std::vector<proto::Overview> overviews;
  std::vector<proto::FrameState> states;
  std::vector<std::string> claims;
};

Recorded record(Tick dropped_at = 0) {
  const TemporaryFolder folder;
  record_simulation(folder.file("a.mcap"), dropped_at);
  Recorded recorded;
  copy_journal(folder.file("a.mcap"), folder.file("b.mcap"), [&](auto topic, auto& message) {
    if (topic == "/overview")
      recorded.overviews.push_back(static_cast<const proto::Overview&>(message));
    if (topic == "/frame_state")
      recorded.states.push_back(static_cast<const proto::FrameState&>(message));
    if (topic == "/claims")
      for (const auto& event : static_cast<const proto::ClaimLog&>(message).event())
        recorded.claims.push_back(event.text());
    return true;
  });
  return recorded;
}

// Tool and bin; the greatest force of its frames, mN.
std::map<std::pair<unsigned, int>, double> greatest_forces(const Recorded& recorded) {
  std::map<std::pair<unsigned, int>, double> greatest;
  for (const auto& state : recorded.states)
    for (const auto& tool : state.tool()) {
      const auto bin = static_cast<int>((state.tick() - 1) / OverviewBuilder::kBinTicks);
      const auto& f = tool.force_n();
      auto& most = greatest[{tool.tool(), bin}];
      most = std::max(most, 1e3 * std::hypot(f.x(), f.y(), f.z()));
    }
  return greatest;
}

TEST(overview, it_says_what_the_frames_say) {
  const auto recorded = record();
  ASSERT_EQ(recorded.overviews.size(), 1u);
  const auto& overview = recorded.overviews.front();
  EXPECT_EQ(overview.first_tick(), 0u);
  EXPECT_EQ(overview.bins(), (kRecordedTicks + 255) / 256);
  ASSERT_EQ(overview.tool_size(), 3);
  const auto greatest = greatest_forces(recorded);
  for (const auto& tool : overview.tool()) {
    ASSERT_EQ(tool.force_mn_size(), static_cast<int>(overview.bins()));
    for (int bin = 0; bin < tool.force_mn_size(); ++bin)
      EXPECT_NEAR(tool.force_mn(bin), greatest.at({tool.tool(), bin}), 0.51);
  }
  // The differences lead to the tip of the last frame.
  for (const auto& last : recorded.states.back().tool()) {
    const auto tool = std::ranges::find(overview.tool(), last.tool(), &proto::OverviewTool::tool);
    double x_um = 0;
    for (const auto step : tool->x_um()) x_um += step;
    const auto& tip = last.has_proxy_position_m() ? last.proxy_position_m() : last.position_m();
    EXPECT_NEAR(x_um, 1e6 * static_cast<double>(tip.x()), 1.0);
  }
  std::vector<std::string> claims;
  for (const auto& event : overview.claim()) claims.push_back(event.text());
  EXPECT_EQ(claims, recorded.claims);
  EXPECT_FALSE(claims.empty());
  EXPECT_GE(overview.change_tick_size(), 1);
  ASSERT_EQ(overview.presence_size(), 1);
  EXPECT_EQ(overview.presence(0).participants().participant_size(), 3);
}

TEST(overview, a_gap_is_in_it) {
  const auto recorded = record(1200);
  ASSERT_EQ(recorded.overviews.size(), 1u);
  ASSERT_EQ(recorded.overviews.front().gap_size(), 1);
  EXPECT_EQ(recorded.overviews.front().gap(0).last_tick(), 1200u);
}

TEST(overview, behind_a_long_gap_another_one_begins) {
  OverviewBuilder builder(0);
  const participants::Roster nobody;
  step::PublishedFrame frame;
  for (frame.tick = 16; frame.tick <= 320; frame.tick += 16) builder.add_frame(frame, nobody);
  EXPECT_FALSE(builder.is_behind(400));
  ASSERT_TRUE(builder.is_behind(5000));
  EXPECT_EQ(builder.take().bins(), 1u);  // no tool was there in the open one
  builder.skip_to(5000);
  frame.tick = 5016;
  builder.add_frame(frame, nobody);
  EXPECT_EQ(builder.take().first_tick(), 5000u);
}

TEST(overview, events_without_end_are_counted_and_not_kept) {
  OverviewBuilder builder(0);
  proto::Participants present;
  for (int i = 0; i < 100; ++i) present.add_participant()->set_name(std::string(100, 'a'));
  constexpr int kLists = 1000;
  for (int i = 0; i < kLists; ++i) builder.add_presence(16, present);
  EXPECT_FALSE(builder.is_empty());
  const auto overview = builder.take();
  EXPECT_LE(overview.ByteSizeLong(), OverviewBuilder::kMostEventBytes + 1000);
  EXPECT_GT(overview.presence_size(), 10);
  EXPECT_EQ(overview.presence_size() + static_cast<int>(overview.left_out()), kLists);
  EXPECT_TRUE(builder.is_empty());
}

}  // namespace
}  // namespace trocar::recording::testing
