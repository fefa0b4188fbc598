// Tissue that remembers stresses: what a cut does to them.

#include <gtest/gtest.h>

#include "common/base/workers.h"
#include "server/tissue/dynamics/tissue.h"
#include "server/tissue/world/relaxation_state.h"
#include "tests/cutting/cut_organ.h"

namespace trocar::cutting::testing {
namespace {

organ::Organ measured_box(bool is_averaged = false) {
  auto organ = box_organ(3, 3, 3, 0.01);
  material::use_measured(*material::find_measured_material("human_liver_nava2008"), organ.material);
  organ.material.has_averaged_strain = is_averaged;
  organ.material.edge_damping_time_s = 0;
  return organ;
}

Vec3f displacement_at(const Vec3d& p) {
  return to_float(Vec3d{3 * p.y * p.x, -2 * p.z * p.z + 0.1 * p.x, 4 * p.x * p.y});
}

// A step advances all tets, or only those whose turn it is.
enum class Advance { All, InTurns };
// Returns the energy's gradient on each node at displacements `u`, after so many steps there.
std::vector<Vec3d> gradients(dynamics::Tissue& tissue, const std::vector<Vec3f>& u,
                             world::RelaxationState& state, int steps,
                             Advance which = Advance::All) {
  using namespace dynamics;
  const auto& groups = tissue.groups();
  std::vector<Float4> x(groups.slot_count());
  for (std::uint32_t n = 0; n < u.size(); ++n) x[groups.slot_of(NodeIndex(n))] = to_float4(u[n]);
  Workers workers(1);
  std::vector<GroupLanes> near;
  for (Group g = 0; g < groups.group_count() && which == Advance::All; ++g)
    near.push_back({g, 0xff});
  if (auto* const strain = tissue.nodal_strain())
    for (Group g = 0; g < groups.group_count(); ++g) strain->restart_group(g, x.data());
  tissue.relaxation()->restart();
  for (int i = 0; i < steps; ++i) {
    tissue.relaxation()->begin_step(0.001f, state, workers);
    tissue.relaxation()->end_step(x.data(), near, state, workers);
  }
  tissue.relaxation()->begin_step(0.001f, state, workers);
  std::vector<Vec3d> out(u.size());
  for (Group g = 0; g < groups.group_count(); ++g) {
    NodeStep8 step{zero_vec8(), zero_sym_mat8()};
    tissue.begin_group(g, x.data(), 0);
    tissue.add(g, x.data(), load_group(&x[g * kLanes]), step);
    Vec3Lanes lanes;
    tissue.relaxed_stress()->refresh({g, 0xff}, x.data(), state);
    store(lanes, step.gradient - tissue.relaxed_stress()->forces(g));
    for (std::size_t lane = 0; lane < kLanes; ++lane)
      if (const auto node = groups.nodes_of(g)[lane]; node.is_valid())
        out[node.value] = to_double(lanes.at(lane));
  }
  return out;
}

// Through hundreds of splits: what a new node bears is what its ends no longer do.
TEST(CutRelaxation, PartsRememberWhatTheWholeDid) {
  const auto organ = measured_box();
  topology::Topology topology(organ);
  Places places(topology);
  dynamics::Tissue tissue(topology);
  world::RelaxationState state(organ);
  std::vector<Vec3f> u;
  for (const auto& p : topology.rest()) u.push_back(displacement_at(p));
  gradients(tissue, u, state, 400);
  // These steps make the tets differ in age, so that parts lie among tets of another age.
  const auto before = gradients(tissue, u, state, 5, Advance::InTurns);
  auto later_state = state;
  const auto later = gradients(tissue, u, later_state, 1);
  double largest = 0, relaxed = 0;
  {
    world::RelaxationState nothing(organ);
    const auto at_once = gradients(tissue, u, nothing, 0);
    for (std::size_t n = 0; n < before.size(); ++n) {
      largest = std::max(largest, length(before[n]));
      relaxed = std::max(relaxed, length(before[n] - at_once[n]));
    }
  }
  ASSERT_GT(relaxed, 0.05 * largest);

  trocar::testing::Random random(5);
  std::vector<TetChild> children;
  struct Made {
    NodeIndex a, b;
    double t;
  };
  std::vector<Made> made;
  while (made.size() < 200) {
    const auto& tet =
        topology.tet(TetIndex(random.below(static_cast<std::uint32_t>(topology.tet_count()))));
    const auto a = tet[random.below(4)], b = tet[random.below(4)];
    if (a == b || length(topology.rest()[a.value] - topology.rest()[b.value]) < 0.004) continue;
    split_edge(topology, places, a, b, 32768, children);
    made.push_back({a, b, 0.5});
    u.push_back((u[a.value] + u[b.value]) * 0.5f);
    state.add_node(a);
    for (const auto& [part, parent] : topology.parts())
      state.tets().inherit(part.value, parent.value);
    tissue.update_topology(topology);
    topology.clear_changes();
  }
  dynamics::Tissue fresh(topology);
  const auto expect_as_before = [&](std::vector<Vec3d> after, const std::vector<Vec3d>& expected) {
    for (std::size_t i = made.size(); i-- > 0;) {
      const auto& bears = after[expected.size() + i];
      after[made[i].a.value] += bears * (1 - made[i].t);
      after[made[i].b.value] += bears * made[i].t;
    }
    for (std::size_t n = 0; n < expected.size(); ++n)
      ASSERT_LT(length(after[n] - expected[n]), 2e-3 * largest) << n;
  };
  for (auto* const each : {&tissue, &fresh}) {
    expect_as_before(gradients(*each, u, state, 0), before);
    later_state = state;
    expect_as_before(gradients(*each, u, later_state, 1), later);
  }
}

// Averages over parts are not those over the whole, but what has followed splits is what it would
// be had it been built so: forces, and what smoothing domains and tets remember.
TEST(CutRelaxation, AveragedTissueFollowsSplitsAsIfBuiltAnew) {
  const auto organ = measured_box(true);
  topology::Topology topology(organ);
  Places places(topology);
  dynamics::Tissue tissue(topology);
  world::RelaxationState state(organ);
  std::vector<Vec3f> u;
  for (const auto& p : topology.rest()) u.push_back(displacement_at(p));
  gradients(tissue, u, state, 100);
  trocar::testing::Random random(6);
  std::vector<TetChild> children;
  for (int made = 0; made < 100;) {
    const auto& tet =
        topology.tet(TetIndex(random.below(static_cast<std::uint32_t>(topology.tet_count()))));
    const auto a = tet[random.below(4)], b = tet[random.below(4)];
    if (a == b || length(topology.rest()[a.value] - topology.rest()[b.value]) < 0.004) continue;
    split_edge(topology, places, a, b, 32768, children);
    ++made;
    u.push_back((u[a.value] + u[b.value]) * 0.5f);
    state.add_node(a);
    for (const auto& [part, parent] : topology.parts())
      state.tets().inherit(part.value, parent.value);
    tissue.update_topology(topology);
    topology.clear_changes();
  }
  auto other_state = state;
  dynamics::Tissue fresh(topology);
  const auto followed = gradients(tissue, u, state, 9, Advance::InTurns);
  const auto built = gradients(fresh, u, other_state, 9, Advance::InTurns);
  double largest = 0;
  for (std::size_t n = 0; n < followed.size(); ++n) {
    ASSERT_EQ(followed[n], built[n]) << n;
    largest = std::max(largest, length(built[n]));
  }
  EXPECT_GT(largest, 0.01);
}

}  // namespace
}  // namespace trocar::cutting::testing
