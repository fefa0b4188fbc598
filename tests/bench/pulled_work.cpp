#include "tests/bench/pulled_work.h"

#include <cmath>
#include <map>
#include <mutex>

#include "tests/bench/reference_fem.h"

namespace trocar::bench {
namespace {

constexpr double kTickSecond = 1e-3;
constexpr int kCompareAtTick = 100;
// Four sweeps are within 1 % of the converged step at 1 ms, and every four more gain a digit.
constexpr std::uint32_t kPulledSweeps = 30;

double face_of(const PulledBox& box, const OurSolver& solver) {
  const auto u = solver.displacements();
  return box.face_displacement(
      [&](NodeIndex node) { return static_cast<double>(u[node.value].x); });
}

// mm at 0.1 s.
double converged_mm(const PulledBox& box, Law law) {
  static std::map<std::pair<std::string, Law>, double> known;
  const auto key = std::pair(box.organ.name, law);
  if (const auto found = known.find(key); found != known.end()) return found->second;
  double u = 0;
  if (law == Law::LinearTets) {
    u = ReferenceFem(box).displacement_after(kCompareAtTick, kTickSecond);
  } else {
    OurSolver solver(box.organ, {.law = law, .sweeps = kPulledSweeps});
    for (int i = 0; i < kCompareAtTick; ++i) solver.step(box.forces_n);
    u = face_of(box, solver);
  }
  return known[key] = u * 1e3;
}

// Records the displacement of a pulled box's face at 0.1 s, while its solver is stepped.
struct Pull {
  std::uint64_t step = 0;
  std::optional<double> u_mm;

  void after_step(double dt_s, const std::function<double()>& face_m) {
    if (++step == static_cast<std::uint64_t>(std::lround(kCompareAtSeconds / dt_s)))
      u_mm = 1e3 * face_m();
  }
};

void judge(Row& row, const Pull& pull, std::optional<double> converged) {
  row.u_mm = pull.u_mm;
  if (!pull.u_mm || !converged) return;
  row.converged_mm = converged;
  row.error_percent = 100 * std::abs(*pull.u_mm - *converged) / std::abs(*converged);
}

}  // namespace

Row row_of(const PulledBox& box, std::string group, std::string solver) {
  Row row;
  row.group = std::move(group);
  row.object = box.organ.name;
  row.solver = std::move(solver);
  row.nodes = box.organ.mesh.node_count();
  row.tets = box.organ.mesh.tets.size();
  row.springs = box.organ.mesh.spring_pairs().size();
  return row;
}

std::string title_of(Law law, const SolverOptions& options) {
  return std::string(name_of(law)) + ", " + std::to_string(options.sweeps) + " sweeps" +
         (options.threads > 1 ? ", " + std::to_string(options.threads) + " threads" : "");
}

Work pull_by_bullet(SharedBox box, BulletLaw law, bool is_implicit, double dt_s) {
  auto peer = std::make_shared<BulletPeer>(*box, law, is_implicit, dt_s);
  auto pull = std::make_shared<Pull>();
  return {[=] {
            const auto took = timed([&] { peer->step(); });
            pull->after_step(dt_s, [&] { return peer->face_displacement(); });
            return took;
          },
          [=](Row& row) {
            std::optional<double> converged;
            if (law == BulletLaw::Linear && is_implicit)
              converged = converged_mm(*box, Law::LinearTets);
            judge(row, *pull, converged);
            row.state_hash = hex(peer->state_hash());
          }};
}

Work pull_by_us(SharedBox box, const SolverOptions& options, bool is_judged) {
  auto solver = std::make_shared<OurSolver>(box->organ, options);
  auto pull = std::make_shared<Pull>();
  return {[=] {
            const auto took = timed([&] { solver->step(box->forces_n); });
            pull->after_step(kTickSecond, [&] { return face_of(*box, *solver); });
            return took;
          },
          [=](Row& row) {
            std::optional<double> converged;
            if (is_judged) converged = converged_mm(*box, options.law);
            judge(row, *pull, converged);
            row.more["residual_n"] = static_cast<double>(solver->last_residual_n());
            row.state_hash = hex(solver->state_hash());
          }};
}

}  // namespace trocar::bench
