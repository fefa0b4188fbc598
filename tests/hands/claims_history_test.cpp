// The rules of ownership over long random histories of hands: of the table alone, on a row of
// nodes, and of the whole tick on a small liver. A failure names its seed.

#include <gtest/gtest.h>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/step/simulation.h"
#include "tests/hands/claim_rules.h"
#include "tests/hands/random_hands.h"

namespace trocar::hands::testing {
namespace {

using tool::Verb;

constexpr int kHands = 6;

// The shorter the row, the more tools want the same nodes.
int row_length(std::uint64_t seed) {
  return seed % 2 == 0 ? 24 : 5;
}

// The table with inbox and tools around it, as a tick has them. Nodes lie in a row, a millimetre
// apart: what a tool reaches follows from where it is.
class Row {
 public:
  explicit Row(std::uint64_t seed)
      : length_(row_length(seed)),
        random_(seed + 1000),
        hands_(seed, {.hands = kHands,
                      .change_period = seed % 3 == 0 ? 30u : 300u,
                      .pose_at =
                          [this](double at) {
                            return Pose{
                                {static_cast<float>(1.2 * at) * 1e-3f * static_cast<float>(length_),
                                 0, 0},
                                {}};
                          },
                      .shape = {}}) {}

  std::string run_tick() {
    ++tick_;
    hands_.act(tick_, inbox_);
    inbox_.drain(inputs_);
    step::admit_inputs(inputs_, tick_, tools_, claims_, grasps_);
    events_.clear();
    if (random_.below(20'000) == 0) {
      ClaimTable returned(node_count_);
      returned.let_go(claims_);
      claims_ = returned;
    }
    if (random_.below(500) == 0) slip();
    if (random_.below(5000) == 0) cut_between();
    collect_requests();
    claims_.update(tick_, requests_, events_);
    for (const auto& event : events_) ++outcomes_[static_cast<std::size_t>(event.outcome)];
    return rules_.check(tick_, claims_, node_count_, requests_, events_);
  }

  int count(ClaimOutcome outcome) const { return outcomes_[static_cast<std::size_t>(outcome)]; }
  const RandomHands::Counts& counts() const { return hands_.counts(); }
  int most_overtaken() const { return rules_.most_overtaken(); }

 private:
  // Tool i reaches 0, 1 or 2 nodes to each side.
  void collect_requests() {
    requests_.clear();
    for (std::uint8_t i = 0; i < kMaxTools; ++i) {
      const auto& tool = tools_[ToolSlot{i}];
      cores_[i].clear();
      if (!tool.has_sample) continue;
      const auto middle = static_cast<int>(tool.pose.position.x * 1e3f), reach = i % 3;
      // Beyond the row there is nothing to reach.
      for (int n = middle - reach; n <= middle + reach; ++n)
        if (n >= 0 && n < length_) cores_[i].push_back(NodeIndex(n));
      requests_.push_back({ToolSlot{i}, tool.verb, tool.last_sample_tick, cores_[i]});
    }
  }

  // A grasp loses a node, as when it is pulled too hard, and the last one ends it.
  void slip() {
    const NodeIndex node(random_.below(static_cast<std::uint32_t>(node_count_)));
    const auto tool = claims_.owner(node);
    if (!tool.is_valid() || claims_.claim(tool).verb != Verb::Grasp) return;
    claims_.release_node(tool, node);
    for (std::size_t n = 0; n < node_count_; ++n)
      if (claims_.owner(NodeIndex(n)) == tool) return;
    claims_.slip_off(tool, tick_, events_);
  }

  void cut_between() {
    const NodeIndex a(random_.below(static_cast<std::uint32_t>(length_) - 1)), b(a.value + 1);
    claims_.add_node(a, b);
    ++node_count_;
  }

  const int length_;  // nodes at the beginning
  trocar::testing::Random random_;
  RandomHands hands_;
  participants::SimulationInbox inbox_;
  TickInputs inputs_;
  ToolTable tools_;
  contact::GraspTable grasps_;
  std::size_t node_count_ = static_cast<std::size_t>(length_);
  ClaimTable claims_{node_count_};
  ClaimRules rules_{claims_, kHands* kToolsPerHand};
  Tick tick_ = 0;
  std::array<std::vector<NodeIndex>, kMaxTools> cores_;
  std::vector<ClaimRequest> requests_;
  std::vector<ClaimEvent> events_;
  std::array<int, wire::kClaimOutcomes> outcomes_{};
};

TEST(ClaimsHistory, OfTheTableKeepsTheRules) {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Row row(seed);
    for (int tick = 1; tick <= 200'000; ++tick) ASSERT_EQ(row.run_tick(), "") << "tick " << tick;
    // The history had all that the rules are about.
    for (const auto outcome :
         {ClaimOutcome::Granted, ClaimOutcome::RefusedHeld, ClaimOutcome::RefusedNothingInReach,
          ClaimOutcome::Released, ClaimOutcome::TakenOver, ClaimOutcome::Expired,
          ClaimOutcome::Slipped})
      EXPECT_GT(row.count(outcome), 0) << static_cast<int>(outcome);
    EXPECT_GT(row.counts().leaves, 3);
    EXPECT_GT(row.counts().silences, 30);
    std::printf("seed %2d: %6d granted, %6d refused, %5d taken over, %5d expired, overtaken %d\n",
                static_cast<int>(seed), row.count(ClaimOutcome::Granted),
                row.count(ClaimOutcome::RefusedHeld), row.count(ClaimOutcome::TakenOver),
                row.count(ClaimOutcome::Expired), row.most_overtaken());
  }
}

// Tools come down on the front half of the liver, on a line across it.
HandsPlan plan_over(const organ::Organ& organ) {
  Vec3d highest{0, -1, 0};
  for (const auto& p : organ.mesh.rest_positions)
    if (p.y > highest.y) highest = p;
  const Vec3f middle = to_float(highest);
  return {.hands = 4,
          .change_period = 150,
          .pose_at =
              [middle](double at) {
                const auto x = static_cast<float>(at - 0.5) * 0.08f;
                return Pose{middle + Vec3f{x, -0.004f, 0}, rotation_from_z({0, 1, 0})};
              },
          .shape = {.radius_m = 0.003f, .reach_m = 0.02f}};
}

// Whoever grasps acts on nodes that the table says are its own.
std::string check_grasps(const step::State& state) {
  for (std::uint8_t i = 0; i < kMaxTools; ++i) {
    const ToolSlot tool{i};
    if (state.claims.claim(tool).phase != ClaimPhase::Held) continue;
    for (const auto node : state.grasps[tool].nodes)
      if (state.claims.owner(node) != tool) return "a grasp acts on a node of another";
  }
  return {};
}

TEST(ClaimsHistory, OfTheWholeTickKeepsTheRules) {
  const auto organ = catalogue::make_liver(catalogue::kMinLiverTets);
  ASSERT_TRUE(organ);
  int granted = 0;
  for (std::uint64_t seed = 11; seed <= 15; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    step::Simulation simulation(*organ);
    RandomHands hands(seed, plan_over(*organ));
    ClaimRules rules(simulation.state().claims, kMaxTools);
    participants::SimulationInbox inbox;
    TickInputs inputs;
    for (Tick tick = 1; tick <= 6000; ++tick) {
      hands.act(tick, inbox);
      if (tick == 1000) inbox.push_mark(MarkAction::Set);
      if (tick % 1500 == 0) inbox.push_mark(MarkAction::Return);
      inbox.drain(inputs);
      simulation.tick(inputs, {});
      const auto frame = simulation.pop_frame();
      const auto& state = simulation.state();
      // Events are told with frames, so what overtakes whom is left to the table's test.
      ASSERT_EQ(rules.check(tick, state.claims, state.world.displacements.size(),
                            simulation.context().contact.requests, {}),
                "")
          << "tick " << tick;
      ASSERT_EQ(check_grasps(state), "") << "tick " << tick;
      if (!frame) continue;
      for (const auto& event : frame->claim_events)
        granted += event.outcome == ClaimOutcome::Granted && event.verb != Verb::Push;
    }
  }
  EXPECT_GT(granted, 100) << "grasps and cuts";
}

}  // namespace
}  // namespace trocar::hands::testing
