// The state hash of short sessions, as numbers: equal with gcc and clang, debug and release, for
// any number of workers (docs/determinism.md). A change of results changes a number here, and
// raises kSimVersion in the same commit.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>

#include "server/organs/organ/organ_file.h"
#include "tests/contact/folded_organ.h"
#include "tests/step/hands.h"

namespace trocar::step {
namespace {

using enum material::ElasticLaw;
using material::StrainEnergy;

// A session, what happens in it, and what has to have happened for the hash to say something.
struct Golden {
  organ::Organ organ;
  int ticks = 0;
  // Inputs of tick 1, 2, ...
  std::function<void(Tick, hands::TickInputs&)> hands;
  std::function<bool(const Simulation&, const TickReport&)> has_happened;
  std::uint64_t hash = 0;
  TickDecisions decisions = {};
};

void expect_golden(const Golden& golden) {
  for (const unsigned workers : {1u, 3u}) {
    Simulation simulation(golden.organ, workers);
    bool has_happened = false;
    for (Tick tick = 1; tick <= static_cast<Tick>(golden.ticks); ++tick) {
      hands::TickInputs inputs;
      golden.hands(tick, inputs);
      simulation.use_workers(1 + static_cast<unsigned>(tick) % workers);  // a team that changes
      const auto& report = simulation.tick(inputs, golden.decisions);
      has_happened |= golden.has_happened(simulation, report);
    }
    EXPECT_TRUE(has_happened);
    EXPECT_EQ(simulation.state_hash(), golden.hash) << workers << " workers";
  }
}

bool is_touched(const Simulation&, const TickReport& report) {
  return report.contact.nodes > 0;
}

Golden two_hands(const organ::Organ& organ, std::uint64_t hash,
                 const TickDecisions& decisions = {}) {
  return {.organ = organ,
          .ticks = 300,
          .hands = [place = testing::place_on(organ)](
                       Tick tick,
                       hands::TickInputs& inputs) { testing::add_two_hands(tick, place, inputs); },
          .has_happened = is_touched,
          .hash = hash,
          .decisions = decisions};
}

organ::Organ liver(material::ElasticLaw law, bool has_averaged_strain = false) {
  auto organ = *catalogue::make_liver(6000);
  organ.material.elastic_law = law;
  organ.material.has_averaged_strain = has_averaged_strain;
  organ.material.poisson_ratio = 0.47;
  organ.gravity_m_s2 = {0, -0.5, 0};  // more, and it sags away from the tools
  return organ;
}

organ::Organ measured_liver(StrainEnergy energy, bool has_averaged_strain = false) {
  auto organ = *catalogue::make_liver(6000);
  auto material = *material::find_measured_material("human_liver_nava2008");
  material.energy = energy;
  if (energy == StrainEnergy::Exponential) material.exponent = 3;
  material::use_measured(material, organ.material);
  organ.material.has_averaged_strain = has_averaged_strain;
  organ.gravity_m_s2 = {0, -0.5, 0};
  return organ;
}

void join(std::uint8_t hand, const tool::ToolShape& shape, hands::TickInputs& inputs) {
  hands::HandJoin join{.slot = {hand}};
  join.shapes[0] = shape;
  inputs.joins.push_back(join);
}

Vec3f highest_of(const organ::Organ& organ) {
  Vec3d highest{0, -1, 0};
  for (const auto& p : organ.mesh.rest_positions)
    if (p.y > highest.y) highest = p;
  return to_float(highest);
}

TEST(Golden, LatticeFrozen) {
  expect_golden(two_hands(catalogue::make_lattice(), 13766465814325416738u,
                          {.depth_limit = kFrozenDepthLimit, .boundary = world::Boundary::Frozen}));
}
TEST(Golden, LatticeGraded) {
  expect_golden(two_hands(catalogue::make_lattice(), 9445163395391312925u));
}
TEST(Golden, TensorMass) {
  expect_golden(two_hands(liver(TensorMass), 13482936766529168765u));
}
TEST(Golden, NeoHookean) {
  expect_golden(two_hands(liver(NeoHookean), 6410652154079730806u));
}
TEST(Golden, NeoHookeanAveraged) {
  expect_golden(two_hands(liver(NeoHookean, true), 14611346558769100806u));
}
TEST(Golden, MeasuredPolynomial) {
  expect_golden(two_hands(measured_liver(StrainEnergy::ReducedPolynomial), 2127443522369678599u));
}
TEST(Golden, MeasuredPolynomialAveraged) {
  expect_golden(
      two_hands(measured_liver(StrainEnergy::ReducedPolynomial, true), 16144056562195544373u));
}
TEST(Golden, MeasuredExponential) {
  expect_golden(two_hands(measured_liver(StrainEnergy::Exponential), 15630492249659452894u));
}

// The default of the programs, with what has relaxed.
TEST(Golden, BuiltInMeasuredLiver) {
  auto golden = two_hands(*catalogue::make_measured_liver(3000), 14372108634978367576u);
  golden.has_happened = [](const Simulation& simulation, const TickReport& report) {
    return report.contact.nodes > 0 && !simulation.state().world.relaxation.is_empty();
  };
  expect_golden(golden);
}

// A blade comes down into the measured liver, which is under tension, and slices along it.
TEST(Golden, CutUnderTension) {
  auto organ = *catalogue::make_liver(6000);
  material::use_measured(*material::find_measured_material("human_liver_nava2008"), organ.material);
  organ.material.tension = 0.03;
  const Vec3f top = highest_of(organ);
  const auto blade = [top](Tick tick, hands::TickInputs& inputs) {
    if (tick == 1) join(0, {.radius_m = 0.002f, .length_m = 0.3f, .edge_m = 0.06f}, inputs);
    if (tick % 4 != 1) return;
    const float t = static_cast<float>(tick) * 1e-3f;
    const float depth = std::min(0.02f, 0.1f * t - 0.005f);
    const float along = 0.1f * std::max(0.0f, t - 0.25f);
    inputs.samples.push_back(
        {tool_slot({0}, 0),
         {{top + Vec3f{-0.03f + along, -depth, 0}, rotation_from_z({0, 1, 0})}, tool::Verb::Cut}});
  };
  double opened = 0;
  expect_golden({.organ = std::move(organ),
                 .ticks = 450,
                 .hands = blade,
                 .has_happened =
                     [&](const Simulation&, const TickReport& report) {
                       opened += report.cut.opened_area_m2;
                       return opened > 1e-5;
                     },
                 .hash = 15801294980394389088u});
}

// A hand takes the end of the left lobe and draws it away until it tears.
TEST(Golden, Tear) {
  auto organ = *catalogue::make_liver(3000);
  organ.material.tear_stretch = 1.3;
  Vec3f end{-1, 0, 0};
  for (const auto& p : organ.mesh.rest_positions)
    if (static_cast<float>(p.x) > end.x) end = to_float(p);
  const auto hand = [end](Tick tick, hands::TickInputs& inputs) {
    if (tick == 1) join(0, {.radius_m = 0.002f, .length_m = 0.3f, .reach_m = 0.02f}, inputs);
    if (tick % 4 != 1) return;
    const Vec3f drawn{0.2f * std::max(0.0f, static_cast<float>(tick) * 1e-3f - 0.15f), 0, 0};
    inputs.samples.push_back(
        {tool_slot({0}, 0), {{end + drawn, rotation_from_z({1, 0, 0})}, tool::Verb::Grasp}});
  };
  expect_golden(
      {.organ = std::move(organ),
       .ticks = 700,
       .hands = hand,
       .has_happened = [](const Simulation&,
                          const TickReport& report) { return report.cut.torn_area_m2 > 0; },
       .hash = 2212263783565009585u});
}

// Two flat tools squeeze a hinged pair of flaps until they touch each other.
TEST(Golden, SelfContact) {
  const contact::testing::Flaps flaps{.length = 6, .width = 4, .damping_per_s = 10};
  auto organ = contact::testing::make_flaps(flaps);
  for (std::size_t i = 0; i < organ.mesh.node_count(); ++i)
    if (organ.mesh.rest_positions[i].x < -flaps.length / 2.0 * flaps.spacing_m + 1e-6)
      organ.fixed_nodes.push_back(NodeIndex(i));
  const float apart = static_cast<float>(flaps.half_height_m()) + 0.0045f;
  const auto tools = [apart](Tick tick, hands::TickInputs& inputs) {
    for (std::uint8_t hand = 0; hand < 2; ++hand) {
      if (tick == 1)
        join(hand, {.radius_m = 0.004f, .length_m = 0.2f, .half_width_m = 0.03f, .friction = 0.6f},
             inputs);
      if (tick % 8 != 1) continue;
      const float closed = 0.0052f * std::min(1.0f, static_cast<float>(tick) / 100.0f);
      const float y = (hand == 0 ? 1.0f : -1.0f) * (apart - closed);
      inputs.samples.push_back({tool_slot({hand}, 0),
                                {{{-0.002f, y, 0}, rotation_from_z({1, 0, 0})}, tool::Verb::Push}});
    }
  };
  expect_golden({.organ = std::move(organ),
                 .ticks = 300,
                 .hands = tools,
                 .has_happened =
                     [](const Simulation& simulation, const TickReport&) {
                       return simulation.state().self_contacts.nodes().size() > 20;
                     },
                 .hash = 4770622079338902858u});
}

}  // namespace
}  // namespace trocar::step
