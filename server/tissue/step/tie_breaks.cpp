#include "server/tissue/step/tie_breaks.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "server/tissue/step/rest.h"

namespace trocar::step {
namespace {

using topology::TieNet;

// An edge that passes beside a tie by as much still meets it: as thick as the tie, where its ends
// lie upon each other.
constexpr double kBreadth_m = 5e-4;

struct Pull {
  std::array<Vec3d, 2> ends;  // m
  Vec3d move;                 // m in a tick, of the middle
  double extension_m = 0;
};

Pull pull_of(const TieNet::Tie& tie, const world::World& world) {
  Pull pull;
  for (std::size_t e = 0; e < 2; ++e) {
    const auto& end = tie.ends[e];
    pull.ends[e] = end.place_m;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto node = end.nodes[k].value;
      pull.ends[e] += to_double(world.displacements[node]) * end.weights[k];
      pull.move +=
          to_double(world.velocities[node]) * (0.5 * end.weights[k] * double{kTickSeconds});
    }
  }
  pull.extension_m = length(pull.ends[1] - pull.ends[0]) - tie.rest_length_m;
  return pull;
}

bool is_at_rest(const TieNet::Tie& tie, const world::World& world) {
  for (const auto& end : tie.ends)
    for (const auto node : end.nodes) {
      const auto of_node = world.node_classes[node.value];
      if (of_node != world::NodeClass::Asleep && of_node != world::NodeClass::Fixed) return false;
    }
  return true;
}

bool is_broken(const TieNet::Tie& tie, float extension_m) {
  return static_cast<double>(extension_m) >= tie.law->full_m();
}

// The way of a blade's edge in a tick.
struct Sweep {
  ToolSlot tool;
  std::array<Vec3d, 2> before, now;
};

bool goes_through(const Vec3d& from, const Vec3d& to, const Vec3d& a, const Vec3d& b,
                  const Vec3d& c) {
  const Vec3d n = cross(b - a, c - a);
  const double over = dot(from - a, n), under = dot(to - a, n);
  if (over == under || (over > 0) == (under > 0)) return false;
  const Vec3d at = from + (to - from) * (over / (over - under));
  return dot(cross(b - a, at - a), n) >= 0 && dot(cross(c - b, at - b), n) >= 0 &&
         dot(cross(a - c, at - c), n) >= 0;
}

bool cuts_through(const Sweep& sweep, const Pull& pull) {
  const Vec3d way = pull.ends[1] - pull.ends[0];
  const Vec3d beyond = normalized(way, Vec3d{0, 1, 0}) * kBreadth_m;
  const Vec3d from = pull.ends[0] - beyond, to = pull.ends[1] + beyond;
  const auto& [a, b] = sweep.now;
  const Vec3d c = sweep.before[0] + pull.move, d = sweep.before[1] + pull.move;
  return goes_through(from, to, a, b, c) || goes_through(from, to, b, d, c);
}

bool may_cut(ToolSlot tool, const TieNet::Tie& tie, const hands::ClaimTable& claims) {
  for (const auto& end : tie.ends)
    for (const auto node : end.nodes)
      if (const auto owner = claims.owner(node); owner.is_valid() && owner != tool) return false;
  return true;
}

class Sweeps {
 public:
  Sweeps(const State& state, std::uint32_t waiting_tools) {
    for (std::uint8_t i = 0; i < kMaxTools; ++i) {
      if ((waiting_tools >> i & 1) != 0) continue;
      const auto edge = state.cuts.sweep_of(ToolSlot{i}, state.tools);
      if (!edge) continue;
      auto& sweep = sweeps_[count_++];
      sweep.tool = ToolSlot{i};
      for (std::size_t e = 0; e < 2; ++e) {
        sweep.before[e] = to_double((*edge)[0][e]);
        sweep.now[e] = to_double((*edge)[1][e]);
      }
    }
  }
  bool empty() const { return count_ == 0; }
  bool cut(const TieNet::Tie& tie, const Pull& pull, const hands::ClaimTable& claims) const {
    return std::any_of(sweeps_.begin(), sweeps_.begin() + count_, [&](const Sweep& sweep) {
      return cuts_through(sweep, pull) && may_cut(sweep.tool, tie, claims);
    });
  }

 private:
  std::array<Sweep, kMaxTools> sweeps_;
  std::uint8_t count_ = 0;
};

// Nodes are not next to each other through a tie any more.
void hand_out_breaks(State& state, StepContext& context) {
  const topology::SurfaceEdit no_edit;
  const auto& topology = state.cuts.topology();
  context.pieces.update({topology, {}, no_edit}, state.world);
  context.near.neighbours.update_changed(topology);
  context.near.queue.forget(state.world.node_count());
  context.near.active.forget();
  hand_out_changes(state.world, context.pieces, context.solve.solver);
  state.cuts.end_edit();
}

}  // namespace

void read_breaks(blades::TissueCuts& cuts, const world::World& world) {
  const auto& ties = cuts.topology().ties();
  for (std::size_t i = 0; i < ties.count(); ++i)
    if (is_broken(ties[i], world.tie_extensions[i])) cuts.break_tie(i);
  cuts.end_edit();
}

TieReport follow_ties(std::uint32_t waiting_tools, State& state, StepContext& context) {
  TieReport report;
  const auto& ties = state.cuts.topology().ties();
  if (ties.count() == 0) return report;
  const Sweeps sweeps(state, waiting_tools);
  for (std::size_t i = 0; i < ties.count(); ++i) {
    const auto& tie = ties[i];
    if (tie.is_gone || tie.is_broken) continue;
    ++report.whole;
    if (sweeps.empty() && is_at_rest(tie, state.world)) continue;
    const auto pull = pull_of(tie, state.world);
    float& most = state.world.tie_extensions[i];
    most = std::max(most, static_cast<float>(pull.extension_m));
    if (!is_broken(tie, most) && !sweeps.cut(tie, pull, state.claims)) continue;
    most = static_cast<float>(kBrokenAt * tie.law->full_m());
    state.cuts.break_tie(i);
    --report.whole;
    ++report.broken;
  }
  if (report.broken > 0) hand_out_breaks(state, context);
  return report;
}

}  // namespace trocar::step
