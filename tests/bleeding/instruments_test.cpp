// Pressing, suction, coagulation and clips on a wound of which everything is known.

#include <gtest/gtest.h>

#include "server/tissue/bleeding/bleeding.h"
#include "tests/bleeding/height_field.h"
#include "tests/support/counted_allocations.h"

namespace trocar::bleeding {
namespace {

using testing::HeightField;

// A flat plate, all of it wound or none, with one tool over its middle.
class Plate {
 public:
  explicit Plate(const tool::ToolShape& shape, bool is_wound = true, Rules rules = {})
      : field_([](double, double) { return 0.0; }), bleeding_(std::move(rules)) {
    if (is_wound) field_.layout.is_wound.assign(field_.layout.triangles.size(), 1);
    tool_.tool = tool_slot({0}, 0);
    tool_.shape = shape;
  }

  // Runs so many frames with the tool as it is then; returns the figures of the last.
  wire::BloodFigures run(int frames, tool::Verb verb, double force_n = 0,
                         const Vec3d& tip_m = {0, 0.001, 0}) {
    tool_.verb = verb;
    tool_.force_n = force_n;
    tool_.tip_m = tip_m;
    wire::BloodFigures last;
    for (int i = 0; i < frames; ++i)
      last = bleeding_.run({field_.layout, field_.displacements}, std::span(&tool_, 1), blood);
    return last;
  }

  Blood blood;

 private:
  HeightField field_;
  Bleeding bleeding_;
  ToolAtWork tool_;
};

constexpr tool::ToolShape kProbe{.radius_m = 0.005f, .form = tool::Form::Probe};
constexpr tool::ToolShape kSuction{.reach_m = 0.014f, .form = tool::Form::Suction};
constexpr tool::ToolShape kCoagulator{.reach_m = 0.014f, .form = tool::Form::Coagulator};
constexpr tool::ToolShape kClipper{.reach_m = 0.014f, .form = tool::Form::Clipper};
constexpr double kPlateM2 = 0.08 * 0.08;

TEST(Instruments, AFreshWoundOozesByItsAreaAndClots) {
  Plate plate(kProbe);
  const Rules rules;
  const auto first = plate.run(1, tool::Verb::None);
  EXPECT_NEAR(static_cast<double>(first.rate_nl_s) * 1e-12, rules.ooze_m_s * kPlateM2,
              1e-3 * rules.ooze_m_s * kPlateM2);
  // After the time of clotting it is down to 1/e, and in the end it stops.
  const auto later = plate.run(5000, tool::Verb::None);
  EXPECT_NEAR(static_cast<double>(later.rate_nl_s) / static_cast<double>(first.rate_nl_s),
              std::exp(-80.0 / rules.clotting_time_s), 0.01);
  const auto end = plate.run(35'000, tool::Verb::None);
  EXPECT_EQ(end.sources, 0u);
  EXPECT_EQ(end.rate_nl_s, 0u);
  // All in all the rate times the time, but for the last thousandth.
  const double all_m3 = rules.ooze_m_s * kPlateM2 * rules.clotting_time_s;
  EXPECT_NEAR(static_cast<double>(end.shed_nl) * 1e-12, all_m3, 0.01 * all_m3);
}

TEST(Instruments, SkinDoesNotBleed) {
  Plate plate(kProbe, false);
  EXPECT_EQ(plate.run(100, tool::Verb::None).shed_nl, 0u);
}

TEST(Instruments, PressingStopsWhatIsBelowWhileItPresses) {
  Plate plate(kProbe);
  const auto open = plate.run(1, tool::Verb::None);
  // 10 mmHg over a circle of 5 mm radius: 0.105 N.
  const auto gentle = plate.run(1, tool::Verb::Push, 0.09);
  EXPECT_EQ(gentle.sources, open.sources);
  const auto firm = plate.run(1, tool::Verb::Push, 0.12);
  EXPECT_LT(firm.sources, open.sources);
  EXPECT_GT(firm.sources, open.sources / 2) << "only what is below";
  EXPECT_EQ(plate.run(1, tool::Verb::None).sources, open.sources);
}

TEST(Instruments, SuctionTakesWhatIsInReachWhileItIsUsed) {
  Plate plate(kSuction);
  plate.run(300, tool::Verb::None);
  EXPECT_EQ(plate.run(1, tool::Verb::None).sucked_nl, 0u);
  const auto before = plate.blood;
  const auto figures = plate.run(200, tool::Verb::Push);
  EXPECT_GT(figures.sucked_nl, 0u);
  const auto& after = plate.blood;
  EXPECT_LT(after.levels[HeightField::kMiddle], before.levels[HeightField::kMiddle]);
  EXPECT_GE(after.levels[HeightField::at(0, 0)], before.levels[HeightField::at(0, 0)])
      << "nothing is taken far away";
  EXPECT_EQ(after.shed_pl, after.on_surface_pl() + after.dripped_pl + after.sucked_pl);
}

TEST(Instruments, CoagulationSealsForGood) {
  Plate plate(kCoagulator);
  const auto open = plate.run(1, tool::Verb::None);
  const auto during = plate.run(1, tool::Verb::Push);
  EXPECT_LT(during.sources, open.sources);
  EXPECT_EQ(plate.run(50, tool::Verb::None).sources, during.sources);
}

TEST(Instruments, OnceWarmAFrameAllocatesNothing) {
  Plate plate(kSuction);
  plate.run(200, tool::Verb::Push);
  const std::size_t before = allocations;
  plate.run(100, tool::Verb::Push);
  EXPECT_EQ(allocations - before, 0u);
}

Rules with_vessel() {
  Rules rules;
  rules.ooze_m_s = 0;
  rules.vessels.push_back(
      {.name = "v", .from_m = {0, -0.05, 0}, .to_m = {0, 0.05, 0}, .radius_m = 0.006});
  return rules;
}

TEST(Instruments, AVesselBleedsUntilItIsPressedHardOrClipped) {
  Plate plate(kClipper, true, with_vessel());
  const auto open = plate.run(1, tool::Verb::None);
  EXPECT_EQ(open.open_vessels, 1u);
  EXPECT_GT(open.rate_nl_s, 0u);
  EXPECT_EQ(plate.run(1, tool::Verb::Push, 0.2).rate_nl_s, open.rate_nl_s)
      << "it bleeds through what would stop parenchyma";
  // Out of reach the jaws find nothing.
  plate.run(1, tool::Verb::Grasp, 0, {0.04, 0, 0});
  EXPECT_EQ(plate.run(1, tool::Verb::None).rate_nl_s, open.rate_nl_s);
  plate.run(1, tool::Verb::Grasp);
  const auto clipped = plate.run(10, tool::Verb::None);
  EXPECT_EQ(clipped.open_vessels, 0u);
  EXPECT_EQ(clipped.rate_nl_s, 0u);
  EXPECT_EQ(plate.blood.clip_vessel.size(), 1u) << "one clip for one closing";
}

}  // namespace
}  // namespace trocar::bleeding
