// Sessions whose far tissue a local reduction moves, against sessions without one.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/lab/calibration/converged.h"
#include "server/tissue/reduction/reduced_tissue.h"
#include "server/tissue/step/simulation.h"
#include "tests/reduce/reduced_block.h"

namespace trocar::step {
namespace {

constexpr float kRadius = 0.012f;
// The reference solves every tick to this residual, and the tests see that it is reached.
const auto kConverged = calibration::converged_decisions(2e-6f);

const reduce::testing::ReducedBlock& made() {
  static const reduce::testing::ReducedBlock instance;
  return instance;
}

Vec3f place_of(std::size_t n) {
  return to_float(made().centre(made().near_top(n)));
}
constexpr Vec3f kOutward{0, 1, 0};

// From the first patch's middle to another's.
Vec3f towards(std::size_t patch, float speed_m_s) {
  const Vec3f way = place_of(patch) - place_of(0);
  return way * (speed_m_s / length(way));
}

// One tool, from 3 mm above a patch's middle along its normal.
struct Press {
  std::size_t patch = 0;
  float depth_m = 0.006f;
  Vec3f aside;  // m/s, once it is down

  hands::TickInputs at(Tick tick) const {
    hands::TickInputs inputs;
    if (tick == 1) {
      hands::HandJoin join{.slot = {0}};
      join.shapes[0] = {.radius_m = kRadius, .length_m = 0.3f, .reach_m = 0.012f};
      inputs.joins.push_back(join);
    }
    const float t = static_cast<float>(tick) * 1e-3f;
    const Vec3f out = kOutward;
    const float height = 0.003f - std::min(depth_m + 0.003f, 0.05f * t);
    const float down_s = (depth_m + 0.003f) / 0.05f;
    inputs.samples.push_back({tool_slot({0}, 0),
                              {{place_of(patch) + out * height + aside * std::max(0.0f, t - down_s),
                                rotation_from_z(out)},
                               tool::Verb::Push}});
    return inputs;
  }
};

Vec3f force_of(const Simulation& simulation, std::size_t tool) {
  const auto& contacts = simulation.context().contact.found;
  return contact::reaction_on(contacts, contacts.tools[tool], simulation.state().world).force_n;
}
Vec3f force_of(const Simulation& simulation) {
  const auto& contacts = simulation.context().contact.found;
  Vec3f force;
  for (const auto& tool : contacts.tools)
    force += contact::reaction_on(contacts, tool, simulation.state().world).force_n;
  return force;
}

double difference_of(const Simulation& a, const Simulation& b) {
  double error = 0, whole = 0;
  for (std::size_t n = 0; n < made().organ.mesh.node_count(); ++n) {
    const auto& u = b.state().world.displacements[n];
    error += length_squared(a.state().world.displacements[n] - u);
    whole += length_squared(u);
  }
  return std::sqrt(error / whole);
}

TEST(ReducedSession, IsNearTheConvergedFullSolution) {
  Simulation reduced(made().organ, 1, reduction::at_work(made().local)), converged(made().organ);
  const Press press{.depth_m = 0.006f};
  for (Tick tick = 1; tick <= 500; ++tick) {
    reduced.tick(press.at(tick), {});
    ASSERT_TRUE(converged.tick(press.at(tick), kConverged).solve.is_converged) << tick;
    if (tick < 100 || tick % 20 != 0) continue;
    ASSERT_TRUE(reduced.context().report.solve.figures.is_reduced()) << tick;
    const Vec3f expected = force_of(converged), found = force_of(reduced);
    EXPECT_LT(length(found - expected), 0.03f * length(expected)) << tick;
    // While it swings, then at rest.
    EXPECT_LT(difference_of(reduced, converged), tick < 400 ? 0.15 : 0.08) << tick;
  }
}

TEST(ReducedSession, GoesOnBitForBitFromASnapshot) {
  Simulation first(made().organ, 1, reduction::at_work(made().local)),
      other(made().organ, 2, reduction::at_work(made().local));
  const Press press{.depth_m = 0.002f, .aside = towards(1, 0.03f)};
  for (Tick tick = 1; tick <= 237; ++tick) first.tick(press.at(tick), {});
  ASSERT_TRUE(first.context().report.solve.figures.is_reduced());
  Bytes snapshot;
  first.write_snapshot(snapshot);
  // The other simulation has run another session before, with more workers.
  for (Tick tick = 1; tick <= 150; ++tick) other.tick(Press{.patch = 1}.at(tick), {});
  ASSERT_TRUE(other.restore_snapshot(snapshot).ok());
  std::uint32_t patches = 0;
  reduction::PatchSet last;
  for (Tick tick = 238; tick <= 900; ++tick) {
    const auto hash = first.tick(press.at(tick), {}).state_hash;
    ASSERT_EQ(other.tick(press.at(tick), {}).state_hash, hash) << tick;
    const auto& figures = first.state().far_model->figures();
    if (figures.is_reduced && !(figures.patches == last)) last = figures.patches, ++patches;
  }
  EXPECT_GE(patches, 2u);
  // A state of a session without the reduction is none of this one, and the other way round.
  Simulation plain(made().organ);
  EXPECT_FALSE(plain.restore_snapshot(snapshot).ok());
}

// Two tools, farther apart than one patch reaches.
class TwoPatches : public ::testing::Test {
 protected:
  static hands::TickInputs inputs_at(Tick tick) {
    auto inputs = Press{.depth_m = 0.004f}.at(tick);
    if (tick == 1) {
      inputs.joins.push_back(inputs.joins[0]);
      inputs.joins.back().slot = {1};
    }
    static const std::size_t patch = far_patch();
    inputs.samples.push_back(Press{.patch = patch, .depth_m = 0.003f}.at(tick).samples[0]);
    inputs.samples.back().tool = tool_slot({1}, 0);
    return inputs;
  }
  // Returns a patch near the top, at least 50 mm from the first.
  static std::size_t far_patch() {
    std::size_t n = 1;
    while (length(place_of(n) - place_of(0)) < 0.05f) ++n;
    return n;
  }
};

TEST_F(TwoPatches, ActTogether) {
  Simulation reduced(made().organ, 1, reduction::at_work(made().local)), converged(made().organ);
  std::size_t preparing = 0;
  for (Tick tick = 1; tick <= 900; ++tick) {
    reduced.tick(inputs_at(tick), {});
    const auto& figures = reduced.state().far_model->figures();
    preparing += figures.reason == wire::SolverReason::Preparing ? 1u : 0u;
    if (tick > 500) {
      EXPECT_EQ(figures.patches.count, 2u) << tick;
    }
    ASSERT_TRUE(converged.tick(inputs_at(tick), kConverged).solve.is_converged) << tick;
  }
  EXPECT_GT(preparing, 20u);
  for (std::size_t tool = 0; tool < 2; ++tool) {
    const Vec3f expected = force_of(converged, tool);
    EXPECT_LT(length(force_of(reduced, tool) - expected), 0.03f * length(expected)) << tool;
  }
  EXPECT_LT(difference_of(reduced, converged), 0.08);
}

TEST_F(TwoPatches, GoOnBitForBitFromSnapshots) {
  Simulation first(made().organ, 1, reduction::at_work(made().local)),
      while_preparing(made().organ, 2, reduction::at_work(made().local)),
      acting(made().organ, 1, reduction::at_work(made().local));
  Bytes snapshot;
  Tick next = 1;
  const auto run_until = [&](auto&& is_so) {
    do first.tick(inputs_at(next), {});
    while (!is_so(first.state().far_model->figures()) && next++ < 2000);
    ++next;
    snapshot.clear();
    first.write_snapshot(snapshot);
  };
  run_until([](const wire::SolverFigures& f) { return f.reason == wire::SolverReason::Preparing; });
  // Made beside something else before.
  for (Tick tick = 1; tick <= 150; ++tick) while_preparing.tick(Press{.patch = 1}.at(tick), {});
  ASSERT_TRUE(while_preparing.restore_snapshot(snapshot).ok());
  const auto start = next;
  run_until([](const wire::SolverFigures& f) { return f.patches.count == 2; });
  for (Tick tick = start; tick < next; ++tick) while_preparing.tick(inputs_at(tick), {});
  ASSERT_TRUE(acting.restore_snapshot(snapshot).ok());
  for (; next <= 900; ++next) {
    const auto hash = first.tick(inputs_at(next), {}).state_hash;
    ASSERT_EQ(while_preparing.tick(inputs_at(next), {}).state_hash, hash) << next;
    ASSERT_EQ(acting.tick(inputs_at(next), {}).state_hash, hash) << next;
  }
}

// Another reduction of this organ has as many patches, but fewer fields.
TEST_F(TwoPatches, AreNotThoseOfAnotherReduction) {
  Simulation first(made().organ, 1, reduction::at_work(made().local));
  for (Tick tick = 1; tick <= 600; ++tick) first.tick(inputs_at(tick), {});
  ASSERT_EQ(first.state().far_model->figures().patches.count, 2u);
  Bytes snapshot;
  first.write_snapshot(snapshot);
  auto fewer = std::make_shared<organ::LocalReduction>(*made().local);
  for (auto& patch : fewer->patches) patch.modes.pop_back();
  for (auto& patch : fewer->patches) {
    const auto gone = fewer->vibrations.size() + patch.modes.size();
    for (auto* lower : {&patch.outer_stiffness, &patch.mass}) {
      std::vector<double> kept;
      for (std::size_t i = 0, at = 0; at < lower->size(); ++i)
        for (std::size_t j = 0; j <= i; ++j, ++at)
          if (i != gone && j != gone) kept.push_back((*lower)[at]);
      *lower = std::move(kept);
    }
  }
  Simulation other(made().organ, 1, reduction::at_work(fewer));
  const auto restored = other.restore_snapshot(snapshot);
  ASSERT_FALSE(restored.ok());
  EXPECT_EQ(other.current_tick(), 0u);
  other.tick(inputs_at(1), {});
}

TEST(ReducedSession, HandsOverWithoutAJump) {
  Simulation switched(made().organ, 1, reduction::at_work(made().local));
  const Press press{.aside = {0.01f, 0, 0.004f}};
  Vec3f before, last;
  std::size_t handed_over = 0;
  double largest = 0;
  bool was_reduced = false;
  for (Tick tick = 1; tick <= 1300; ++tick) {
    // On and off, at no regular times.
    const TickDecisions decisions{.is_reduction_off = tick * tick / 53 % 2 == 0};
    const bool is_reduced = switched.tick(press.at(tick), decisions).solve.figures.is_reduced();
    const Vec3f now = force_of(switched);
    if (tick > 200 && is_reduced != was_reduced) {
      ++handed_over;
      largest =
          std::max(largest, static_cast<double>(length(now - last * 2 + before) / length(now)));
    }
    was_reduced = is_reduced;
    before = last;
    last = now;
  }
  EXPECT_GT(handed_over, 100u);
  EXPECT_LT(largest, 0.015);
}

// A blade goes along one side of the top, while a tool presses near the other.
class CutSession : public ::testing::Test {
 protected:
  static constexpr Vec3f kPlace{0, 0.03f, -0.035f};

  static hands::TickInputs inputs_at(Tick tick) {
    auto inputs = Press{.depth_m = 0.004f}.at(tick);
    inputs.samples[0].sample.world_from_tool.position += nearest_centre() - place_of(0);
    if (tick == 1) {
      hands::HandJoin join{.slot = {1}};
      join.shapes[0] = {.radius_m = 0.002f, .length_m = 0.3f, .edge_m = 0.04f};
      inputs.joins.push_back(join);
    }
    const float t = static_cast<float>(tick) * 1e-3f - 0.4f;
    const float depth = t < 0.5f ? std::min(0.012f, 0.1f * t) : 0.012f - 0.2f * (t - 0.5f);
    const float along = 0.1f * std::clamp(t - 0.1f, 0.0f, 0.4f);
    inputs.samples.push_back({tool_slot({1}, 0),
                              {{{-0.02f + along, 0.03f - depth, 0.047f}, rotation_from_z(kOutward)},
                               t < 0.7f ? tool::Verb::Cut : tool::Verb::None}});
    return inputs;
  }
  static Vec3f nearest_centre() {
    std::size_t best = 0;
    for (std::size_t n = 0; n < made().local->patches.size(); ++n)
      if (length(place_of(n) - kPlace) < length(place_of(best) - kPlace)) best = n;
    return place_of(best);
  }
};

TEST_F(CutSession, GoesOnReducedElsewhere) {
  Simulation reduced(made().organ, 1, reduction::at_work(made().local)), full(made().organ);
  std::size_t crossed = 0, reduced_before = 0, reduced_after = 0;
  Tick last_cut = 0;
  Bytes snapshot;
  for (Tick tick = 1; tick <= 2400; ++tick) {
    const auto report = reduced.tick(inputs_at(tick), {});
    full.tick(inputs_at(tick), {});
    ASSERT_EQ(report.solve.nodes_rejected, 0u) << tick;
    crossed += report.cut.crossed_tets;
    if (report.cut.splits > 0) last_cut = tick;
    (last_cut == 0 ? reduced_before : reduced_after) += report.solve.figures.is_reduced() ? 1u : 0u;
    if (tick == 2000) reduced.write_snapshot(snapshot);
  }
  EXPECT_GT(crossed, 20u);
  EXPECT_GT(reduced_before, 200u);
  EXPECT_GT(reduced_after, 500u);
  EXPECT_TRUE(reduced.context().report.solve.figures.is_reduced());
  const Vec3f expected = force_of(full);
  EXPECT_LT(length(force_of(reduced) - expected), 0.03f * length(expected));
  // A session that is restored with a wound goes on bit for bit.
  Simulation other(made().organ, 1, reduction::at_work(made().local));
  ASSERT_TRUE(other.restore_snapshot(snapshot).ok());
  for (Tick tick = 2001; tick <= 2400; ++tick) other.tick(inputs_at(tick), {});
  EXPECT_EQ(other.state_hash(), reduced.state_hash());
}

// Motion of the swept nodes alone must not build up in the fields while they are swept: it would
// appear when they are let go.
TEST(ReducedSession, FieldsStayWithTheNodesThatAreSwept) {
  Simulation reduced(made().organ, 1, reduction::at_work(made().local)), full(made().organ);
  const reduction::LocalModels models(*made().local, made().organ);
  const Press press;
  const Tick down = 1000, lifted = 1300;
  for (Tick tick = 1; tick <= lifted; ++tick) {
    auto inputs = press.at(tick);
    if (tick > down)
      inputs.samples[0].sample.world_from_tool.position +=
          kOutward * std::min(0.04f, 4e-5f * static_cast<float>(tick - down));
    reduced.tick(inputs, {});
    full.tick(inputs, {});
    if (tick % 100 != 0 || tick < 300) continue;
    ASSERT_TRUE(reduced.context().report.solve.figures.is_reduced()) << tick;
    const auto& tissue = static_cast<const reduction::ReducedTissue&>(*reduced.state().far_model);
    const auto& state = tissue.state().far;
    const auto& model = models[state.patches.patches[0]];
    std::vector<float> amplitudes(state.amplitudes.begin(), state.amplitudes.end());
    amplitudes.resize(model.stride());
    std::vector<float> moved(3 * model.nodes().size());
    reduction::add_fields(model.basis(), amplitudes, moved);
    float astray = 0;
    for (std::size_t n = 0; n < model.nodes().size(); ++n)
      astray = std::max(astray, length(reduced.state().world.displacements[model.nodes()[n].value] -
                                       Vec3f{moved[3 * n], moved[3 * n + 1], moved[3 * n + 2]}));
    EXPECT_LT(astray, 1.5e-3f) << tick;  // else 3 mm at once, 4 at tick 600
    EXPECT_LT(difference_of(reduced, full), 0.1) << tick;
  }
}

TEST(ReducedSession, ComesToRestWhereTheFullOneDoes) {
  Simulation reduced(made().organ, 1, reduction::at_work(made().local)), full(made().organ);
  auto end = Press{}.at(2);
  end.samples[0].sample.world_from_tool.position += kOutward * 0.05f;
  for (Tick tick = 1; tick <= 4000; ++tick) {
    const auto inputs = tick <= 300 ? Press{}.at(tick) : end;
    reduced.tick(inputs, {});
    full.tick(inputs, {});
  }
  float farthest = 0;
  for (std::size_t n = 0; n < made().organ.mesh.node_count(); ++n)
    farthest = std::max(farthest, length(reduced.state().world.displacements[n] -
                                         full.state().world.displacements[n]));
  EXPECT_LT(farthest, 1e-4f);
}

}  // namespace
}  // namespace trocar::step
