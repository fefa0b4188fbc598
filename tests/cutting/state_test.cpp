// The state of a cutter: what is read back goes on as what was written would have.

#include <gtest/gtest.h>

#include <cmath>

#include "server/organs/catalogue/load_organ.h"
#include "tests/cutting/random_strokes.h"
#include "tests/support/shared.h"

namespace trocar::cutting::testing {
namespace {

constexpr std::uint32_t kBlades = 3;

// Three hands that begin, go on and end at random, in tissue that sways.
class Hands {
 public:
  Hands(const organ::Organ& organ, double h, std::uint64_t seed)
      : strokes_(organ, h, seed), h_(h) {}

  // The same moves for all of them.
  void tick(std::span<CutOrgan* const> organs) {
    for (std::uint32_t blade = 0; blade < kBlades; ++blade) {
      auto& hand = hands_[blade];
      if (hand.at == hand.path.size()) {
        for (auto* const organ : organs) organ->cutter().lift(blade);
        if (strokes_.random().below(4) != 0) continue;
        hand = {strokes_.next(strokes_.any_kind()), 0};
      }
      for (auto* const organ : organs) organ->cutter().move(blade, hand.path[hand.at]);
      ++hand.at;
    }
    ++ticks_;
    for (auto* const organ : organs) {
      sway(*organ);
      organ->tick();
    }
  }

 private:
  void sway(CutOrgan& organ) const {
    organ.displacements.resize(organ.topology().node_count());
    for (std::size_t n = 0; n < organ.displacements.size(); ++n) {
      const auto& p = organ.topology().rest()[n];
      const double phase = 20 * (p.x + p.y + p.z) + 0.05 * ticks_;
      organ.displacements[n] = to_float(
          Vec3d{std::sin(phase), std::cos(1.3 * phase), std::sin(phase + p.x)} * (0.4 * h_));
    }
  }

  struct Hand {
    Path path;
    std::size_t at = 0;
  };
  RandomStrokes strokes_;
  std::array<Hand, kBlades> hands_;
  double h_;
  int ticks_ = 0;
};

void expect_same(CutOrgan& a, CutOrgan& b, const std::string& when) {
  ASSERT_EQ(a.last().events, b.last().events) << when;
  ASSERT_EQ(a.state(), b.state()) << when;
  ASSERT_EQ(a.last().is_behind, b.last().is_behind) << when;
}

// How many restored in the middle of a stroke, with work waiting.
int restore_again_and_again(const organ::Organ& organ, std::uint64_t seed, int times) {
  Settings settings;
  settings.edits_per_call = 12;
  auto original = std::make_unique<CutOrgan>(organ, settings);
  Hands hands(organ, original->cutter().mean_h(), seed);
  trocar::testing::Random random(seed);
  int behind = 0;
  for (int time = 0; time < times; ++time) {
    CutOrgan* const alone[] = {original.get()};
    for (auto ticks = 5 + random.below(60); ticks-- > 0;) hands.tick(alone);
    behind += original->last().is_behind;
    auto restored = std::make_unique<CutOrgan>(organ, settings);
    EXPECT_EQ(restored->resume(*original), "");
    CutOrgan* const both[] = {original.get(), restored.get()};
    for (int tick = 0; tick < 30; ++tick) {
      hands.tick(both);
      expect_same(*original, *restored, "seed " + std::to_string(seed));
      if (::testing::Test::HasFatalFailure()) return behind;
    }
    EXPECT_EQ(topology_hash(original->topology()), topology_hash(restored->topology()));
    EXPECT_EQ(restored->check(), "");
    original = std::move(restored);
  }
  EXPECT_GT(original->total().splits, 100u);
  return behind;
}

TEST(CutterState, OfAnIdleCutterIsSixBytes) {
  CutOrgan box(box_organ(4, 4, 4, 0.01));
  EXPECT_EQ(box.state().size(), 6u);
  box.stroke(straight_path({{0.003, -0.06, -0.06}, {0.003, -0.06, 0.06}},
                           {{0.003, 0.06, -0.06}, {0.003, 0.06, 0.06}}, 0.002));
  EXPECT_EQ(box.state().size(), 6u);
  box.cutter().move(3, Edge{{0, 0, 0}, {0, 0, 0.01}});
  EXPECT_GT(box.state().size(), 100u);
  EXPECT_LT(box.state().size(), 300u);
}

TEST(CutterState, ABoxGoesOnAsItWould) {
  int behind = 0;
  for (const std::uint64_t seed : {1, 2, 3, 4})
    behind += restore_again_and_again(box_organ(6, 6, 6, 0.01), seed, 6);
  EXPECT_GT(behind, 0);
}
TEST(CutterState, ALiverGoesOnAsItWould) {
  TROCAR_SKIP_WITHOUT_SHARED("organs/liver_tiny.msh");
  const auto path = trocar::testing::shared_folder() / "organs/liver_tiny.msh";
  for (const std::uint64_t seed : {5, 6})
    restore_again_and_again(*catalogue::load_organ(path.string()), seed, 5);
}
TEST(CutterState, AGallbladderGoesOnAsItWould) {
  TROCAR_SKIP_WITHOUT_SHARED("organs/gallbladder_wall.msh");
  const auto path = trocar::testing::shared_folder() / "organs/gallbladder_wall.msh";
  restore_again_and_again(*catalogue::load_organ(path.string()), 7, 5);
}

// Equal moves at other places of strokes and with other numbers of them: equal bytes.
TEST(CutterState, SaysNothingOfStrokesThatAreOver) {
  const auto organ = box_organ(4, 4, 4, 0.01);
  CutOrgan a(organ), b(organ);
  for (int i = 0; i < 5; ++i) {
    EXPECT_TRUE(b.cutter().move(1, Edge{{1, 0, 0}, {1, 0, 0.01}}));
    if (i == 4) {
      EXPECT_TRUE(b.cutter().move(2, Edge{{0.04, -0.03, 0}, {0.04, 0.03, 0}}));
    }
    b.cutter().lift(1);
    b.run_until_idle();
  }
  EXPECT_TRUE(a.cutter().move(2, Edge{{0.04, -0.03, 0}, {0.04, 0.03, 0}}));
  EXPECT_EQ(a.state(), b.state());
}

TEST(CutterState, RepeatsOnlyWhatFitsAndOnlyWhenNoBladeIsOn) {
  const auto organ = box_organ(3, 3, 3, 0.01);
  CutOrgan box(organ);
  CutEvents events;
  events.events = {Split{NodeIndex(0u), NodeIndex(1u), 32768, NodeIndex(64u)}};
  EXPECT_TRUE(box.cutter().move(0, Edge{{0, 0, 0}, {0, 0, 0.01}}));
  std::vector<topology::NewNode> made;
  EXPECT_FALSE(box.cutter().repeat(events, made).ok());
  box.cutter().lift(0);
  box.run_until_idle();
  ASSERT_TRUE(box.cutter().repeat(events, made).ok());
  ASSERT_EQ(made.size(), 1u);
  EXPECT_EQ(made.front().node, NodeIndex(64u));
  EXPECT_FALSE(box.cutter().repeat(events, made).ok());
  EXPECT_EQ(box.topology().node_count(), 65u);
}

// In the middle of three strokes.
class ReadingStates : public ::testing::Test {
 protected:
  ReadingStates() : organ_(box_organ(4, 4, 4, 0.01)), box_(organ_, settings()) {
    Hands hands(organ_, box_.cutter().mean_h(), 8);
    CutOrgan* const alone[] = {&box_};
    for (int tick = 0; tick < 400 && (tick < 40 || !box_.last().is_behind); ++tick)
      hands.tick(alone);
    state_ = box_.state();
  }
  static Settings settings() {
    Settings settings;
    settings.edits_per_call = 24;
    return settings;
  }
  // Whether the bytes are taken; whatever they are, cutting goes on and breaks nothing.
  bool reads(BytesView bytes) {
    CutOrgan other(organ_, settings());
    EXPECT_EQ(other.resume(box_), "");
    auto archive = world::StateArchive::reading(bytes);
    other.cutter().visit_state(archive);
    if (!archive.ok()) {
      EXPECT_EQ(other.state().size(), 6u);
    }
    for (int tick = 0; tick < 3; ++tick) {
      other.cutter().move(0, Edge{{0.002 * tick, -0.03, 0}, {0.002 * tick, 0.03, 0}});
      other.tick();
    }
    for (std::uint32_t blade = 0; blade < kMaxBlades; ++blade) other.cutter().lift(blade);
    other.run_until_idle();
    EXPECT_EQ(validate(other.topology()).ok() ? "" : "invalid", std::string());
    return archive.ok() && archive.at_end();
  }

  const organ::Organ organ_;
  CutOrgan box_;
  Bytes state_;
};

TEST_F(ReadingStates, CutShortIsRefused) {
  ASSERT_GT(state_.size(), 1000u);
  EXPECT_TRUE(reads(state_));
  for (std::size_t size = 0; size < state_.size(); size += size < 200 ? 1 : 97)
    EXPECT_FALSE(reads(BytesView(state_).first(size))) << size;
}

TEST_F(ReadingStates, ChangedBreaksNothing) {
  trocar::testing::Random random(9);
  int refused = 0;
  for (int i = 0; i < 400; ++i) {
    auto bytes = state_;
    const auto size = static_cast<std::uint32_t>(bytes.size());
    for (auto changes = 1 + random.below(3); changes-- > 0;)
      bytes[random.below(random.below(2) == 0 ? 200 : size)] =
          static_cast<std::uint8_t>(random.below(3) == 0 ? 255 : random.below(256));
    refused += !reads(bytes);
  }
  EXPECT_GT(refused, 100);
}

}  // namespace
}  // namespace trocar::cutting::testing
