// What linear tets of a nearly incompressible material lose: plain, with the volume averaged over
// each node's tets (the live solver), and quadratic ones, at table 1's ratio of bulk modulus to
// C10.

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>

#include "server/finite_elements/scenario_solve.h"
#include "tests/validation/experiments.h"
#include "tests/validation/organs.h"
#include "tests/validation/scenario_text.h"

namespace trocar::validation {
namespace {

using finite_elements::ElementOrder;
using finite_elements::ScenarioSolve;

// How far quadratic and averaged tets may be off on the finest mesh that the live solver gets: a
// bonded square has singular edges. In the short form the reference itself is coarse.
constexpr double kQuadraticBound = 0.05, kShortQuadraticBound = 0.15, kAveragedBound = 0.2;

// Young's modulus and Poisson's ratio of C10 and K of table 1 in the live solver's neo-Hookean law.
struct Elastic {
  double young_pa, poisson;
};
Elastic elastic() {
  const auto& liver = *scene::find_measured_material("human_liver_nava2008");
  const double mu = 2 * liver.coefficients_pa[0], lambda = liver.bulk_modulus_pa - mu;
  const double poisson = lambda / (2 * (lambda + mu));
  return {2 * mu * (1 + poisson), poisson};
}

struct Geometry {
  const char* name;
  const char* title;
  const char* quantity;  // what the table shows
  double per_si;         // to its unit
  scene::Organ (*organ)(int cells);
  // Sets, loads and one probe; and which component of it counts.
  std::string (*text)();
  double (*value)(const Vec3d& probe);
  std::vector<int> cells;
  int reference_cells;  // of quadratic elements
};

// Loads grow over the load steps: at once they would turn small tets inside out.
std::string traction(const Vec3d& pa) {
  return fmt::format(
      "[[traction]]\nset = \"end\"\n[[traction.key]]\ntime_s = 0\ntraction_pa = [0, 0, 0]\n"
      "[[traction.key]]\ntime_s = 1\ntraction_pa = [{:.9g}, {:.9g}, {:.9g}]\n\n",
      pa.x, pa.y, pa.z);
}

scene::Organ beam(int cells) {
  return tet_box(even(0.02, cells), even(0.08, 4 * cells), even(0.02, cells));
}
std::string bend_text() {
  return box_set("end", {-10, 40, -10}, {10, 40, 10}) + traction({8, 0, 0}) +
         "[[probe]]\nset = \"end\"\nquantity = \"displacement\"\n";
}

// Cook's membrane as a solid: 48 long, 44 high at its clamp and 16 at its end, 10 thick; mm. Lies
// along y, so that its clamp is the lowest layer.
scene::Organ cook(int cells) {
  auto organ = tet_box(even(0.048, cells), even(0.048, cells), even(0.01, std::max(1, cells / 4)));
  for (auto& p : organ.mesh.rest_positions) {
    const double along = p.y / 0.048 + 0.5, across = p.x / 0.048 + 0.5;
    const double low = 0.044 * along, high = 0.044 + 0.016 * along;
    p = {low + across * (high - low), along * 0.048, p.z};
  }
  mesh::centre_on_origin(organ.mesh);
  organ.node_masses_kg = scene::lumped_masses(organ);
  organ.name = "cook";
  return organ;
}
std::string cook_text() {
  return box_set("end", {-40, 24, -6}, {40, 24, 6}) + near_set("corner", {30, 24, 5}, 0) +
         traction({60, 0, 0}) + "[[probe]]\nset = \"end\"\nquantity = \"displacement\"\n";
}

scene::Organ block(int cells) {
  return tet_box(even(0.06, 3 * cells), even(0.03, 3 * cells / 2), even(0.06, 3 * cells));
}
std::string press_text() {
  return box_set("punch", {-10, 15, -10}, {10, 15, 10}) +
         displace("punch", {{0, {}}, {1, {0, -4, 0}}}) +
         "[[probe]]\nset = \"punch\"\nquantity = \"reaction\"\n";
}

const std::vector<Geometry>& geometries() {
  static const std::vector<Geometry> kAll{{"bar",
                                           "bending bar, 20 x 80 x 20 mm",
                                           "deflection, mm",
                                           1e3,
                                           beam,
                                           bend_text,
                                           [](const Vec3d& u) { return u.x; },
                                           {2, 4},
                                           6},
                                          {"cook",
                                           "Cook's membrane, 10 mm thick",
                                           "rise of the end, mm",
                                           1e3,
                                           cook,
                                           cook_text,
                                           [](const Vec3d& u) { return u.x; },
                                           {4, 8},
                                           16},
                                          {"press",
                                           "square of 20 mm pressed in by 4 mm",
                                           "force, N",
                                           1,
                                           block,
                                           press_text,
                                           [](const Vec3d& f) { return -f.y; },
                                           {2, 4},
                                           6}};
  return kAll;
}

class Study {
 public:
  Study(const Lab& lab, Section& section, const Geometry& geometry)
      : lab_(lab), section_(section), geometry_(geometry) {}

  double live(int cells) const {
    const auto run =
        lab_.start(section_, geometry_.title, fmt::format("locking-{}-{}", geometry_.name, cells),
                   text(cells, true, 4));
    lab_.finish(section_, *run);
    return geometry_.value(run->probe(0)) * geometry_.per_si;
  }

  // NaN where no equilibrium was found.
  double finite_elements(int cells, ElementOrder order) const {
    show_progress(fmt::format("{}: {} cells, off-line", geometry_.name, cells));
    auto parsed = scene::parse_scenario_text(text(cells, false, 1),
                                             (lab_.scenarios() / "locking.toml").string());
    TROCAR_ASSERT(parsed.ok());
    auto resolved = scene::resolve(std::move(*parsed));
    TROCAR_ASSERT(resolved.ok());
    auto solve = ScenarioSolve::create(std::move(*resolved), {.order = order});
    TROCAR_ASSERT(solve.ok());
    while (!(*solve)->is_finished())
      if (!(*solve)->step().is_converged) return std::nan("");
    return geometry_.value((*solve)->probe(0)) * geometry_.per_si;
  }

 private:
  std::string text(int cells, bool is_averaged, int load_steps) const {
    const auto name = fmt::format("locking-{}-{}", geometry_.name, cells);
    lab_.keep_organ(name, geometry_.organ(cells));
    const auto [young_pa, poisson] = elastic();
    return organ_source(name + ".organ") +
           fmt::format(
               "[material]\nelastic_law = \"neo-hookean\"\nyoung_modulus_pa = {:.9g}\n"
               "poisson_ratio = {:.9g}\n{}\n[run]\nmode = \"static\"\nseconds = 1\nload_steps = "
               "{}\n"
               "over_relaxation = 1.8\ntolerance_n = 5e-6\nmax_sweeps = 20000\n\n",
               young_pa, poisson, is_averaged ? "averaged_volume = true\n" : "", load_steps) +
           geometry_.text();
  }

  const Lab& lab_;
  Section& section_;
  const Geometry& geometry_;
};

void measure(const Lab& lab, Section& section, const Geometry& geometry) {
  const Study study(lab, section, geometry);
  const int finest = lab.is_short() ? geometry.cells.back() : geometry.reference_cells;
  const double reference = study.finite_elements(finest, ElementOrder::Quadratic);
  const auto off = [&](double value) { return shown_percent(value / reference - 1); };
  Table table{fmt::format("{}: {}", geometry.title, geometry.quantity),
              {"cells", "linear", "off", "averaged volume", "off", "quadratic", "off"},
              {}};
  double plain = 0, averaged = 0, quadratic = 0;
  for (const int n : geometry.cells) {
    plain = study.finite_elements(n, ElementOrder::Linear);
    averaged = study.live(n);
    const double here = n == finest ? reference : study.finite_elements(n, ElementOrder::Quadratic);
    if (n != finest) quadratic = here;
    table.rows.push_back({std::to_string(n), shown(plain), off(plain), shown(averaged),
                          off(averaged), shown(here), off(here)});
  }
  if (finest != geometry.cells.back())
    table.rows.push_back({std::to_string(finest), "", "", "", "", shown(reference), "reference"});
  section.add(std::move(table));
  const auto name = [&](const char* what) { return fmt::format("{}-{}", geometry.name, what); };
  section.compare(name("quadratic"), reference, quadratic,
                  lab.is_short() ? kShortQuadraticBound : kQuadraticBound, geometry.quantity,
                  "Quadratic elements on the mesh before the reference's.");
  section.compare(name("averaged"), reference, averaged, kAveragedBound, geometry.quantity,
                  "Live solver, averaged volume, against the reference.");
  section.at_least(name("plain-locks"), "farther off than averaged",
                   std::abs(plain / reference - 1) / std::abs(averaged / reference - 1), 1.1,
                   "Error of plain linear tets over that of tets with averaged volume.");
}

}  // namespace

void run_locking(const Lab& lab, Section& section) {
  const auto [young_pa, poisson] = elastic();
  section.say(fmt::format(
      "C10 = 883.8 Pa and K = 40 C10 of table 1 in the neo-Hookean law, which all three have: E = "
      "{:.0f} Pa, Poisson's ratio {:.3f}. Five tets per cell. Linear tets are the off-line "
      "solver's, and equal to the live solver's without averaging; quadratic ones on the finest "
      "mesh are the reference.",
      young_pa, poisson));
  for (const auto& geometry : geometries()) measure(lab, section, geometry);
}

}  // namespace trocar::validation
