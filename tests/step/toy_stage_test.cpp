// A toy that changes with the tick: warmth around the tips of tools. It shows how something new
// becomes part of the state, its hash and its snapshots; docs/determinism.md goes the same way.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/step/tick.h"

namespace trocar::step {
namespace {

// The state, and what it may be.
struct Warmth {
  std::vector<float> kelvin;  // per node, above the body

  void visit_state(world::StateArchive& archive, std::size_t nodes) {
    archive.sized_array(kelvin, static_cast<std::uint32_t>(nodes));
    const auto is_warm = [](float k) { return std::isfinite(k) && k >= 0; };
    if (archive.is_reading() && !(kelvin.size() == nodes && std::ranges::all_of(kelvin, is_warm)))
      archive.fail();
  }
};

// The stage: what it reads is const.
void warm(const hands::ToolTable& tools, const world::World& world, Warmth& warmth) {
  warmth.kelvin.resize(world.node_count());  // new nodes are as warm as the body
  for (auto& kelvin : warmth.kelvin) kelvin *= 0.999f;
  for (std::uint8_t slot = 0; slot < kMaxTools; ++slot) {
    const auto& tool = tools[ToolSlot{slot}];
    for (std::size_t i = 0; tool.has_sample && i < world.node_count(); ++i)
      if (length(world.position(NodeIndex(i)) - tool.pose.position) < 0.02f)
        warmth.kelvin[i] += 0.1f;
  }
}

class WarmTissue {
 public:
  WarmTissue() : scene_{.organ = *catalogue::make_liver(800)}, state_(scene_) {
    warmth_.kelvin.resize(state_.world.node_count());
  }

  std::uint64_t tick(const hands::TickInputs& inputs) {
    run_tick(inputs, {}, nullptr, state_, *context_);
    warm(state_.tools, state_.world, warmth_);
    StateHasher hasher;
    auto archive = world::StateArchive::hashing(hasher);
    visit(archive);
    return hasher.digest();
  }
  Bytes snapshot() {
    Bytes bytes;
    auto archive = world::StateArchive::writing(bytes);
    visit(archive);
    return bytes;
  }
  bool restore(BytesView bytes) {
    auto archive = world::StateArchive::reading(bytes);
    visit(archive);
    context_.emplace(scene_, 1, state_);  // it follows from the state
    return archive.ok() && archive.at_end();
  }
  float warmest() const { return *std::ranges::max_element(warmth_.kelvin); }

 private:
  void visit(world::StateArchive& archive) {
    warmth_.visit_state(archive, state_.world.node_count());
    state_.visit(archive);  // its last part may take no bytes
  }

  Scene scene_;
  State state_;
  std::optional<StepContext> context_{std::in_place, scene_, 1, state_};
  Warmth warmth_;
};

TEST(ToyStage, IsInTheHashAndTheSnapshotAndGoesOnFromThere) {
  WarmTissue tissue, restored;
  hands::TickInputs inputs;
  inputs.joins.push_back({.slot = {0}, .tool_count = 1, .shapes = {tool::ToolShape{}, {}}});
  inputs.samples.push_back({tool_slot({0}, 0), {Pose{}, tool::Verb::None}, 0});
  tissue.tick(inputs);
  for (int tick = 0; tick < 50; ++tick) tissue.tick({});
  EXPECT_GT(tissue.warmest(), 1);
  auto bytes = tissue.snapshot();
  ASSERT_TRUE(restored.restore(bytes));
  for (int tick = 0; tick < 50; ++tick) EXPECT_EQ(tissue.tick({}), restored.tick({}));
  EXPECT_EQ(tissue.warmest(), restored.warmest());
  std::fill_n(bytes.begin() + 4, sizeof(float), std::uint8_t{0xff});  // the first is no number
  EXPECT_FALSE(WarmTissue().restore(bytes));
}

}  // namespace
}  // namespace trocar::step
