// No allocation in a tick after warm-up. Publishing makes one frame object for other threads every
// 16th tick: those ticks are counted separately and bounded.

#include <gtest/gtest.h>

#include "tests/step/hands.h"
#include "tests/support/counted_allocations.h"

namespace trocar::step {
namespace {

TEST(Tick, DoesNotAllocateAfterWarmUp) {
  Simulation simulation(catalogue::make_lattice());
  const Vec3f place = testing::place_on(simulation.organ());
  // Warm-up and measurement replay the same motion: the second run finds its capacity ready.
  Bytes start;
  simulation.write_snapshot(start);
  hands::TickInputs inputs;
  inputs.samples.reserve(8);
  std::size_t between = 0, publishing = 0, largest_publish = 0;
  for (Tick tick = 1; tick <= 1600; ++tick) {
    inputs.clear();
    testing::add_two_hands(tick, place, inputs);
    const std::size_t before = allocations;
    simulation.tick(inputs, {});
    const std::size_t count = allocations - before;
    if (publishes_frame(tick)) {
      largest_publish = std::max(largest_publish, count);
      ++publishing;
    } else if (tick > 400 && tick < 1200) {
      between += count;
    }
    simulation.pop_frame();
  }
  EXPECT_EQ(between, 0u);
  EXPECT_GT(publishing, 0u);
  EXPECT_LE(largest_publish, 12u);
}

}  // namespace
}  // namespace trocar::step
