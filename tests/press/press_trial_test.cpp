// A press by hand: the force follows the material's law, and the organ comes back.

#include "server/lab/press/press_trial.h"

#include <gtest/gtest.h>

#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/edit/editor.h"

namespace trocar::press {
namespace {

organ::Organ liver_of(double young_modulus_pa) {
  edit::Editor editor(*catalogue::make_liver(2000));
  EXPECT_TRUE(editor.use_neo_hookean({}, young_modulus_pa, 0.45).ok());
  return editor.organ();
}

struct Place {
  Vec3f position, outward;
};
// The surface node that is farthest to the front.
Place foremost(const organ::Organ& organ) {
  const auto& p = organ.mesh.rest_positions;
  const auto normals = mesh::surface_normals(organ.mesh);
  NodeIndex front = organ.mesh.surface_nodes.front();
  for (const NodeIndex node : organ.mesh.surface_nodes)
    if (p[node.value].z > p[front.value].z) front = node;
  return {to_float(p[front.value]), to_float(normals[front.value])};
}

Reading pressed(PressTrial& trial, const Place& place, double depth_m, int ticks) {
  trial.begin(place.position, place.outward);
  for (int i = 0; i < ticks; ++i) trial.tick(depth_m);
  EXPECT_FALSE(trial.readings().empty());
  return trial.readings().back();
}

// All stresses of the law are in proportion to Young's modulus, so the force at rest is. What holds
// the tip out is of a fixed stiffness, some hundred times that of the tissue, which 5 % allow for.
TEST(PressTrial, TwiceTheModulusIsTwiceTheForce) {
  const auto soft = liver_of(4000), stiff = liver_of(8000);
  PressTrial soft_trial(soft, 0.010), stiff_trial(stiff, 0.010);
  const auto place = foremost(soft);
  const auto a = pressed(soft_trial, place, 0.006, 1200);
  const auto b = pressed(stiff_trial, place, 0.006, 1200);
  EXPECT_GT(a.force_n, 0.02);
  EXPECT_NEAR(b.force_n / a.force_n, 2, 0.1);
}

TEST(PressTrial, DeeperIsHarder) {
  const auto organ = liver_of(4000);
  PressTrial trial(organ, 0.010);
  const auto place = foremost(organ);
  const auto shallow = pressed(trial, place, 0.003, 800);
  trial.end();
  const auto deep = pressed(trial, place, 0.008, 800);
  EXPECT_GT(deep.force_n, shallow.force_n);
  EXPECT_GT(deep.depth_m, shallow.depth_m);
  EXPECT_LE(deep.depth_m, 0.008 + 1e-6) << "the tip is no deeper than the hand";
}

TEST(PressTrial, TheOrganComesBackToTheBit) {
  const auto organ = liver_of(4000);
  PressTrial trial(organ, 0.010);
  const auto before = trial.state_hash();
  const auto place = foremost(organ);
  const auto first = pressed(trial, place, 0.008, 200);
  EXPECT_NE(trial.state_hash(), before);
  trial.end();
  EXPECT_FALSE(trial.is_pressed());
  EXPECT_EQ(trial.state_hash(), before);
  for (const Vec3f& displacement : trial.displacements()) EXPECT_EQ(displacement, Vec3f{});
  const auto again = pressed(trial, place, 0.008, 200);
  EXPECT_EQ(again.force_n, first.force_n);
  EXPECT_EQ(again.depth_m, first.depth_m);
}

TEST(PressTrial, WithoutAPressNothingMoves) {
  const auto organ = liver_of(4000);
  PressTrial trial(organ, 0.010);
  const auto before = trial.state_hash();
  trial.tick(0.01);
  EXPECT_EQ(trial.state_hash(), before);
  EXPECT_TRUE(trial.readings().empty());
}

}  // namespace
}  // namespace trocar::press
