#include "common/wire/figures.h"

#include <gtest/gtest.h>

#include <limits>

#include "common/wire/figure_messages.h"
#include "proto/wire.pb.h"

namespace trocar::wire {
namespace {

// Sets each field to a number of its own. The structured bindings name every field: with a new
// figure this does not compile until it is set here, and then fails until both ends carry it.
FrameFigures distinct_figures() {
  FrameFigures figures;
  int last = 20;
  const auto set = [&last](auto&... fields) {
    ((fields = static_cast<std::remove_reference_t<decltype(fields)>>(++last)), ...);
  };
  auto& [near, solve, relaxation, blood, state_hash, pace] = figures;
  set(state_hash);
  {
    auto& [active_nodes, queue_nodes, node_limit, region_count] = near;
    set(active_nodes, queue_nodes, node_limit, region_count);
  }
  {
    auto& [sweeps, far_sweeps, far_interval, layer_sweeps, residual_n] = solve;
    set(sweeps, far_sweeps, far_interval, residual_n);
    for (auto& count : layer_sweeps) set(count);
  }
  {
    auto& [energy_j, volume_change, relaxed_share] = relaxation.emplace();
    set(energy_j, volume_change, relaxed_share);
  }
  {
    auto& [shed, on_surface, dripped, sucked, rate, sources, vessels] = blood.emplace();
    set(shed, on_surface, dripped, sucked, rate, sources, vessels);
  }
  auto& [stage_median_us, tick_median_us, tick_p99_us, slow_ticks, rate] = pace;
  for (auto& median : stage_median_us) set(median);
  set(tick_median_us, tick_p99_us, slow_ticks);
  auto& [level, budget_us, predicted_us, lowered, raised, time_rate, waiting_tools] = rate;
  level = RateLevel::Overloaded;
  set(budget_us, predicted_us, lowered, raised, time_rate, waiting_tools);
  return figures;
}

FrameFigures carried(const FrameFigures& figures) {
  proto::FrameState message;
  write(figures, message);
  proto::FrameState received;
  EXPECT_TRUE(received.ParseFromString(message.SerializeAsString()));
  const auto read_back = read(received);
  EXPECT_TRUE(read_back.ok());
  return read_back.ok() ? *read_back : FrameFigures{};
}

TEST(figures, every_one_is_carried) {
  const auto figures = distinct_figures();
  EXPECT_EQ(carried(figures), figures);
  EXPECT_EQ(carried({}), FrameFigures{});
  for (std::size_t i = 0; i < kRateLevels; ++i) {
    auto with_level = figures;
    with_level.pace.rate.level = static_cast<RateLevel>(i);
    EXPECT_EQ(carried(with_level), with_level) << i;
  }
}

TEST(figures, a_message_that_is_used_again_keeps_nothing) {
  proto::FrameState message;
  write(distinct_figures(), message);
  write(FrameFigures{}, message);
  EXPECT_EQ(*read(message), FrameFigures{});
}

TEST(figures, without_its_pace_a_message_is_the_same_in_each_run) {
  auto one = distinct_figures(), other = one;
  other.pace = {};
  proto::FrameState messages[2];
  write(one, messages[0]);
  write(other, messages[1]);
  EXPECT_NE(messages[0].SerializeAsString(), messages[1].SerializeAsString());
  for (auto& message : messages) write(PaceFigures{}, message);
  EXPECT_EQ(messages[0].SerializeAsString(), messages[1].SerializeAsString());
  one.pace = {};
  EXPECT_EQ(*read(messages[0]), one) << "the rest is still there";
}

TEST(figures, of_an_older_server_are_as_by_default) {
  const auto figures = read(proto::FrameState{});
  ASSERT_TRUE(figures.ok());
  EXPECT_EQ(*figures, FrameFigures{});
}

TEST(figures, levels_of_a_newer_server_are_not_told) {
  proto::FrameState message;
  write(distinct_figures(), message);
  auto expected = distinct_figures();
  expected.pace.rate.level = RateLevel::Fixed;
  for (const int newer : {10, 1000, -1}) {
    message.mutable_rate()->set_level(static_cast<proto::RateLevel>(newer));
    EXPECT_EQ(*read(message), expected) << newer;
  }
}

TEST(figures, what_cannot_be_is_refused_by_its_field) {
  const auto error_of = [](auto change) {
    proto::FrameState message;
    write(distinct_figures(), message);
    change(message);
    const auto figures = read(message);
    return figures.ok() ? std::string("none") : figures.error().message;
  };
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(error_of([](auto& m) { m.mutable_rate()->add_layer_sweeps(1); }),
            "FrameState.rate: there are over 4 layers");
  EXPECT_EQ(error_of([](auto& m) { m.mutable_rate()->set_budget_us(-1); }),
            "FrameState.rate: a time is negative or not finite");
  EXPECT_EQ(error_of([](auto& m) { m.mutable_relaxation()->set_relaxed_share(kNan); }),
            "FrameState.relaxation: a number is not finite");
}

}  // namespace
}  // namespace trocar::wire
