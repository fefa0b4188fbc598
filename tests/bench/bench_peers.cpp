// The peer and us, in one process and run: the three boxes, implicit steps of 1 ms by every law
// that both know, explicit steps where they are stable.

#include "tests/bench/pulled_work.h"

namespace trocar::bench {
namespace {

struct BulletCase {
  const char* name;
  BulletLaw law;
  bool is_implicit;
};
constexpr BulletCase kBulletCases[] = {
    {"Bullet linear, implicit", BulletLaw::Linear, true},
    {"Bullet neo-Hookean, implicit", BulletLaw::NeoHookean, true},
    {"Bullet mass-spring, implicit", BulletLaw::MassSpring, true},
    {"Bullet linear, explicit", BulletLaw::Linear, false},
    {"Bullet neo-Hookean, explicit", BulletLaw::NeoHookean, false},
    {"Bullet mass-spring, explicit", BulletLaw::MassSpring, false},
};

struct Mesh {
  BoxShape shape;
  double explicit_dt_s;  // the largest of 0.5 and 1 ms at which explicit linear tets are stable
  std::uint64_t short_steps, full_steps;
};

void add_box(Suite& suite, const Mesh& mesh) {
  auto box = std::make_shared<const PulledBox>(make_pulled_box(mesh.shape));
  const auto steps = suite.steps(100, mesh.short_steps, mesh.full_steps);
  for (const auto& peer : kBulletCases) {
    const double dt = peer.is_implicit ? 1e-3 : mesh.explicit_dt_s;
    Row row = row_of(*box, "peers", peer.name);
    row.dt_ms = dt * 1e3;
    const auto run = peer.is_implicit ? steps : suite.steps(200, 200, 400);
    add_work(suite, row, run,
             [=](Row&) { return pull_by_bullet(box, peer.law, peer.is_implicit, dt); });
  }
  for (const Law law : kLaws)
    for (const std::uint32_t threads : {1u, 2u}) {
      if (!has(law) || threads > max_threads()) continue;
      if (threads > 1 && suite.is_smoke() && law != Law::LinearTets) continue;
      const SolverOptions options{.law = law, .threads = threads};
      Row row = row_of(*box, "peers", "ours, " + title_of(law, options));
      row.threads = threads;
      add_work(suite, row, steps, [=](Row&) { return pull_by_us(box, options, true); });
    }
}

}  // namespace

void add_peers(Suite& suite) {
  if (suite.is_smoke()) {
    add_box(suite, {{"small box", {6, 3, 3}, {0.06, 0.03, 0.03}, CellSplit::Five}, 0.5e-3, 0, 0});
    return;
  }
  add_box(suite, {plate_box(), 0.5e-3, 200, 600});
  add_box(suite, {liver_box(), 1e-3, 200, 300});
  add_box(suite, {chest_box(), 0.5e-3, 100, 220});
}

}  // namespace trocar::bench
