// No allocation in ticks in which a patch acts, nor when it hands over, after warm-up.

#include <gtest/gtest.h>

#include <cmath>

#include "server/tissue/reduction/reduced_tissue.h"
#include "server/tissue/step/simulation.h"
#include "tests/reduce/reduced_block.h"
#include "tests/support/counted_allocations.h"

namespace trocar::step {
namespace {

TEST(ReducedTick, DoesNotAllocateAfterWarmUp) {
  const reduce::testing::ReducedBlock made(4);
  Simulation simulation(made.organ, 1, reduction::at_work(made.local));
  const Vec3f place = to_float(made.centre(0));
  const Vec3f out = std::abs(place.y) > 0.025f   ? Vec3f{0, place.y > 0 ? 1.0f : -1.0f, 0}
                    : std::abs(place.x) > 0.055f ? Vec3f{place.x > 0 ? 1.0f : -1.0f, 0, 0}
                                                 : Vec3f{0, 0, place.z > 0 ? 1.0f : -1.0f};
  hands::TickInputs inputs;
  inputs.samples.reserve(8);
  std::size_t reduced = 0, handing_over = 0, between = 0, hand_overs = 0;
  bool was_reduced = false;
  for (Tick tick = 1; tick <= 2000; ++tick) {
    inputs.clear();
    if (tick == 1) {
      hands::HandJoin join{.slot = {0}};
      join.shapes[0] = {.radius_m = 0.012f, .length_m = 0.3f, .reach_m = 0.012f};
      inputs.joins.push_back(join);
    }
    const float depth = 0.003f * (1 - std::cos(6.2831853f * static_cast<float>(tick) / 500));
    inputs.samples.push_back(
        {tool_slot({0}, 0),
         {{place + out * (0.0005f - depth), rotation_from_z(out)}, tool::Verb::Push}});
    // The full solver now and then, from ticks on that publish no frame.
    const TickDecisions decisions{.is_reduction_off = (tick + 7) % 400 < 100};
    const std::size_t before = allocations;
    const bool is_reduced = simulation.tick(inputs, decisions).solve.figures.is_reduced();
    const std::size_t count = allocations - before;
    simulation.pop_frame();
    const bool hands_over = is_reduced != was_reduced;
    was_reduced = is_reduced;
    if (tick < 1000 || publishes_frame(tick)) continue;
    reduced += is_reduced ? 1u : 0u;
    hand_overs += hands_over ? 1u : 0u;
    (hands_over ? handing_over : between) += count;
  }
  EXPECT_GT(reduced, 400u);
  EXPECT_GE(hand_overs, 4u);
  EXPECT_EQ(between, 0u);
  EXPECT_EQ(handing_over, 0u);
}

}  // namespace
}  // namespace trocar::step
