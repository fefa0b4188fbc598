// Compares what runs out of an opened vessel with the laws of its supply and of an orifice.

#include "server/tissue/bleeding/vessels.h"

#include <gtest/gtest.h>

#include <cmath>

namespace trocar::bleeding {
namespace {

TEST(Vessels, OutflowIsThatOfAnOrificeWhereTheOpeningIsSmall) {
  const Vessel vessel{.pressure_pa = 10'000, .most_flow_m3_s = 1e-3};
  const double area = 1e-8;
  const double orifice = kOrificeCoefficient * area * std::sqrt(2 * 10'000 / kBloodDensity);
  EXPECT_NEAR(outflow_m3_s(vessel, area) / orifice, 1, 0.01);
}

TEST(Vessels, OutflowIsTheSupplyWhereItLiesOpenWide) {
  const Vessel vessel{.pressure_pa = 10'000, .most_flow_m3_s = 1e-6};
  EXPECT_NEAR(outflow_m3_s(vessel, 1e-3) / 1e-6, 1, 0.01);
}

TEST(Vessels, OutflowUsesUpThePressureAndGrowsWithTheOpening) {
  const Vessel vessel{.pressure_pa = 12'000, .most_flow_m3_s = 3e-6};
  double before = 0;
  for (const double area : {1e-8, 1e-7, 1e-6, 4e-6, 1e-5}) {
    const double flow = outflow_m3_s(vessel, area);
    const double speed = flow / (kOrificeCoefficient * area);
    EXPECT_NEAR(12'000 * flow / 3e-6 + kBloodDensity / 2 * speed * speed, 12'000, 1e-3);
    EXPECT_GT(flow, before);
    before = flow;
  }
  EXPECT_EQ(outflow_m3_s(vessel, 0), 0);
}

TEST(Vessels, AMouthIsThePartOfTheWoundWithinTheTube) {
  // One wound triangle of 40 mm sides across a tube of 3 mm radius: its cross-section lies in it.
  Rules rules;
  rules.vessels.push_back(
      {.name = "v", .from_m = {0, -0.05, 0}, .to_m = {0, 0.05, 0}, .radius_m = 0.003});
  wire::SurfaceLayout layout;
  const std::vector<Vec3d> rest{{-0.012, 0, -0.012}, {0.03, 0, -0.012}, {-0.012, 0, 0.03}};
  layout.rest_quanta = wire::quantise_rest(rest);
  layout.triangles.push_back({VertexIndex(0), VertexIndex(1), VertexIndex(2)});
  layout.is_wound.push_back(1);
  OpenVessels vessels;
  vessels.add(rules, layout, 0);
  ASSERT_EQ(vessels.mouths().size(), 1u);
  const double exact = 3.14159265 * 0.003 * 0.003;
  // Sampled by 64 triangles of 13.8 mm^2: as near as two of them.
  EXPECT_NEAR(vessels.mouths()[0].area_m2, exact, 2 * 0.042 * 0.042 / 2 / 64);
  layout.is_wound[0] = 0;
  OpenVessels closed;
  closed.add(rules, layout, 0);
  EXPECT_TRUE(closed.mouths().empty()) << "skin opens no vessel";
}

}  // namespace
}  // namespace trocar::bleeding
