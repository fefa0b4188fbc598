// The off-line solver beside CalculiX, an independent one: the same meshes, the first three terms
// of table 1 in the isochoric form, which both have.

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>

#include "server/lab/finite_elements/surface_traction.h"
#include "tests/validation/calculix.h"
#include "tests/validation/experiments.h"
#include "tests/validation/organs.h"

namespace trocar::validation {
namespace {

using finite_elements::ElementOrder;

// The displacement print of ccx has seven digits; its increments end at a residual of 1e-7.
constexpr double kBound = 1e-4;

material::HyperelasticMaterial three_terms(material::VolumeSplit split) {
  auto material = *material::find_measured_material("human_liver_nava2008");
  material.name = "table 1, three terms";
  material.coefficients_pa[3] = material.coefficients_pa[4] = 0;
  material.relaxation.clear();
  material.split = split;
  return material;
}

struct Setting {
  const char* name;
  const char* title;
  Vec3d size_m;
  void (*load)(const organ::Organ& organ, finite_elements::Problem& problem,
               finite_elements::Loads& loads);
};

// Degrees of freedom of the nodes there; the value of `move` for each.
void hold(finite_elements::Problem& problem, finite_elements::Loads& loads,
          bool (*is_there)(const Vec3d&), const Vec3d& move) {
  const auto& p = problem.mesh.rest_positions;
  for (std::uint32_t n = 0; n < p.size(); ++n) {
    if (!is_there(p[n])) continue;
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
      problem.held_dofs.push_back(3 * n + axis);
      loads.held_moves.push_back(axis == 0 ? move.x : axis == 1 ? move.y : move.z);
    }
  }
}

// Held and moved nodes have been listed set by set.
void sort_holds(finite_elements::Problem& problem, finite_elements::Loads& loads) {
  std::vector<std::pair<std::uint32_t, double>> holds;
  for (std::size_t i = 0; i < problem.held_dofs.size(); ++i)
    holds.emplace_back(problem.held_dofs[i], loads.held_moves[i]);
  std::sort(holds.begin(), holds.end());
  for (std::size_t i = 0; i < holds.size(); ++i)
    problem.held_dofs[i] = holds[i].first, loads.held_moves[i] = holds[i].second;
}

// A block of 60 x 30 x 60 mm, a square of 20 mm in the middle of its top pressed in by 5 mm and
// drawn aside by 3 mm.
void press_calculix(const organ::Organ&, finite_elements::Problem& problem,
                    finite_elements::Loads& loads) {
  hold(problem, loads, [](const Vec3d& p) { return p.y < -0.015 + 1e-9; }, {});
  hold(problem, loads,
       [](const Vec3d& p) {
         return p.y > 0.015 - 1e-9 && std::abs(p.x) < 0.01 + 1e-9 && std::abs(p.z) < 0.01 + 1e-9;
       },
       {0.003, -0.005, 0});
  sort_holds(problem, loads);
}

// A bar of 20 x 80 x 20 mm, clamped at one end and bent by an even traction at the other.
void bend(const organ::Organ& organ, finite_elements::Problem& problem,
          finite_elements::Loads& loads) {
  hold(problem, loads, [](const Vec3d& p) { return p.y < -0.04 + 1e-9; }, {});
  std::vector<std::uint8_t> is_end;
  for (const auto& p : organ.mesh.rest_positions) is_end.push_back(p.y > 0.04 - 1e-9 ? 1 : 0);
  const auto shares = finite_elements::area_shares(organ.mesh, problem.mesh, is_end);
  for (std::size_t n = 0; n < shares.size(); ++n)
    loads.forces[static_cast<Eigen::Index>(3 * n)] = 25 * shares[n];
}

struct Solved {
  Field field;
  bool is_converged = false;
};
Solved solve(const finite_elements::Problem& problem, const finite_elements::Loads& loads) {
  finite_elements::Solver solver(problem);
  Solved solved;
  solved.is_converged = solver.step(loads, {}).is_converged;
  const auto& u = solver.displacements();
  for (Eigen::Index i = 0; i < u.size(); i += 3) solved.field.push_back({u[i], u[i + 1], u[i + 2]});
  return solved;
}

struct Case {
  const Setting& setting;
  int across;  // cells over 20 mm
  ElementOrder order;

  std::string name() const {
    return fmt::format("{}-{}-{}", setting.name,
                       order == ElementOrder::Linear ? "linear" : "quadratic", across);
  }
};

void compare(const Lab& lab, Section& section, Table& table, const Case& c) {
  const auto cells = [&](double length) {
    return even(length, static_cast<int>(std::lround(length / 0.02 * c.across)));
  };
  const auto& size = c.setting.size_m;
  const auto organ = tet_box(cells(size.x), cells(size.y), cells(size.z));
  show_progress(c.name());
  auto problem = finite_elements::make_problem(
      finite_elements::make_elements(organ.mesh, organ.mesh.rest_positions, c.order),
      three_terms(material::VolumeSplit::Isochoric));
  auto loads = finite_elements::no_loads(problem);
  c.setting.load(organ, problem, loads);
  const auto ours = solve(problem, loads);
  const auto input = calculix_input(problem, loads);
  TROCAR_ASSERT(input.ok());
  const auto theirs = run_calculix(lab.scenarios(), c.name(), *input, problem.mesh.node_count());
  auto unsplit = problem;
  unsplit.materials = {three_terms(material::VolumeSplit::Unsplit)};
  const auto other = solve(unsplit, loads);
  const double error =
      theirs && ours.is_converged ? field_error(ours.field, *theirs) : std::nan("");
  if (!theirs) section.say("CalculiX: " + theirs.error().message);
  section.at_most(c.name(), theirs ? shown(largest(*theirs) * 1e3) + " mm" : "none", error,
                  law(kBound, "the same discrete equations"),
                  "Field of displacements of all nodes, middle ones too, against CalculiX.");
  table.rows.push_back(
      {c.setting.title, c.order == ElementOrder::Linear ? "linear" : "quadratic",
       std::to_string(problem.mesh.node_count()), shown(largest(ours.field) * 1e3),
       theirs ? shown(largest(*theirs) * 1e3) : "none",
       theirs ? fmt::format("{:.1e}", error) : "none",
       other.is_converged ? shown_percent(field_error(other.field, ours.field)) : "none"});
}

}  // namespace

void run_calculix_comparison(const Lab& lab, Section& section) {
  section.say(
      "CalculiX (ccx) has the reduced polynomial up to its third term in the isochoric form, with "
      "(J - 1)^2 / D; so both solve with C10, C20 and C30 of table 1, D = 2 / K, K = 40 C10, and "
      "without relaxation, on the same meshes of four-node and ten-node tets. The last column is "
      "what the unsplit form, the one of the live solver, makes of the same load: how much the "
      "choice of form matters.");
  if (!has_calculix()) {
    section.say("LEFT OUT: ccx is not installed (package calculix-ccx).");
    return;
  }
  const std::vector<Setting> settings{
      {"press", "block, pressed", {0.06, 0.03, 0.06}, press_calculix},
      {"bend", "bar, bent", {0.02, 0.08, 0.02}, bend}};
  Table table{"Displacements beside CalculiX",
              {"experiment", "elements", "nodes", "ours, largest, mm", "CalculiX, mm",
               "field, relative", "unsplit form differs by"},
              {}};
  for (const auto& setting : settings)
    for (const int across : lab.is_short() ? std::vector<int>{2} : std::vector<int>{2, 4})
      for (const auto order : {ElementOrder::Linear, ElementOrder::Quadratic})
        compare(lab, section, table, {setting, across, order});
  section.add(std::move(table));
}

}  // namespace trocar::validation
