#include "tests/bench/our_solver.h"

#include <algorithm>
#include <thread>
#include <vector>

#include "common/base/assert.h"
#include "common/base/checksum.h"
#include "server/tissue/dynamics/block_descent.h"
#include "server/tissue/world/world.h"

namespace trocar::bench {

const char* name_of(Law law) {
  switch (law) {
    case Law::Springs:
      return "springs";
    case Law::LinearTets:
      return "linear tets";
    case Law::NeoHookean:
      return "neo-Hookean tets";
    case Law::NeoHookeanAveraged:
      return "neo-Hookean tets, averaged strain";
  }
  return "?";
}

organ::Organ with_law(organ::Organ organ, Law law) {
  auto& material = organ.material;
  material.elastic_law = law == Law::Springs      ? material::ElasticLaw::Springs
                         : law == Law::LinearTets ? material::ElasticLaw::TensorMass
                                                  : material::ElasticLaw::NeoHookean;
  material.has_averaged_strain = law == Law::NeoHookeanAveraged;
  return organ;
}

bool has(Law) {
  return true;
}
std::uint32_t max_threads() {
  return std::max(1u, std::thread::hardware_concurrency());
}

struct OurSolver::Engine {
  Engine(const organ::Organ& o, const SolverOptions& options)
      : organ(with_law(o, options.law)), world(organ), solver(organ, world, options.threads) {
    settings = {.sweeps = options.sweeps,
                .over_relaxation = options.over_relaxation,
                .residual_tolerance_n = options.tolerance_n};
    for (std::uint32_t n = 0; n < world.node_count(); ++n)
      if (world.node_classes[n] != world::NodeClass::Fixed) {
        world.node_classes[n] = world::NodeClass::Active;
        free_nodes.push_back(NodeIndex(n));
      }
  }

  organ::Organ organ;
  world::World world;
  dynamics::BlockDescent solver;
  dynamics::SolveSettings settings;
  dynamics::SolveReport report;
  contact::ContactList no_contacts;
  std::vector<NodeIndex> free_nodes;
};

OurSolver::OurSolver(const organ::Organ& organ, const SolverOptions& options) {
  TROCAR_ASSERT(has(options.law) && options.threads <= max_threads());
  engine_ = std::make_unique<Engine>(organ, options);
}

OurSolver::~OurSolver() = default;

void OurSolver::step(std::span<const Vec3f> forces_n) {
  Engine& e = *engine_;
  ++e.world.tick;
  e.report = e.solver.solve(e.no_contacts, e.free_nodes, e.settings, e.world, {.forces = forces_n});
}

std::span<const Vec3f> OurSolver::displacements() const {
  return engine_->world.displacements;
}

std::uint64_t OurSolver::state_hash() const {
  StateHasher hasher;
  auto archive = world::StateArchive::hashing(hasher);
  engine_->world.visit_state(archive);
  return hasher.digest();
}

std::uint32_t OurSolver::last_sweeps() const {
  return engine_->report.sweeps;
}
float OurSolver::last_residual_n() const {
  return engine_->report.residual_n;
}

}  // namespace trocar::bench
