// Contact forces of the tissue that sessions have by default, beside quadratic elements. Nothing in
// the live solver was chosen on these organs but the liver.

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "server/lab/calibration/places.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "tests/validation/experiments.h"
#include "tests/validation/off_line.h"
#include "tests/validation/organs.h"
#include "tests/validation/scenario_text.h"

namespace trocar::validation {
namespace {

using finite_elements::ElementOrder;

constexpr double kPressTarget = 0.05;
constexpr std::uint64_t kPlacesSeed = 24;

// One organ, and the patch that is pressed into it.
struct PressedOrgan {
  const char* name;
  const char* title;
  organ::Organ organ;
  double young_pa, poisson;
  double patch_mm, depth_mm;
  double tolerance_n;
  // The largest errors on record where the target is missed, else 0.
  double mean_on_record = 0, worst_on_record = 0;
};

// Young's modulus and Poisson's ratio of C10 and K of the measured liver, at small strains.
std::pair<double, double> liver_moduli() {
  const auto& liver = *material::find_measured_material("human_liver_nava2008");
  const double mu = 2 * liver.coefficients_pa[0], lambda = liver.bulk_modulus_pa - mu;
  const double poisson = lambda / (2 * (lambda + mu));
  return {2 * mu * (1 + poisson), poisson};
}

organ::Organ scaled(organ::Organ organ, double factor) {
  for (auto& p : organ.mesh.rest_positions) p *= factor;
  organ.node_masses_kg = organ::lumped_masses(organ);
  return organ;
}

// The patch is three elements across at least: a point load diverges with refinement. The slab is
// three cells thick and held below, the stomach's wall two tets thick.
std::vector<PressedOrgan> pressed_organs(const Lab& lab) {
  const auto [young_pa, poisson] = liver_moduli();
  std::vector<PressedOrgan> organs;
  organs.push_back({"small-liver", "liver a third as long, a tenth as stiff",
                    scaled(*catalogue::make_liver(6500), 1.0 / 3), young_pa / 10, poisson, 7, 2,
                    1e-6});
  organs.push_back({"slab", "slab, 60 x 15 x 60 mm, held below",
                    tet_box(even(0.06, 12), even(0.015, 3), even(0.06, 12)), 4000, 0.45, 9, 3, 2e-6,
                    0, lab.is_short() ? 0 : 0.11});
  if (lab.is_short()) return organs;
  organs.push_back(
      {"liver", "built-in liver", *catalogue::make_liver(), young_pa, poisson, 12, 5, 5e-5});
  organs.push_back({"stomach", "built-in stomach, a wall of 7 mm", *catalogue::make_stomach(), 4000,
                    0.45, 12, 5, 1e-5, 0.065, 0.09});
  return organs;
}

std::string patch_text(const PressedOrgan& pressed, const calibration::Place& place,
                       bool is_averaged) {
  return organ_source(fmt::format("presses-{}.organ", pressed.name)) +
         fmt::format(
             "[material]\nelastic_law = \"neo-hookean\"\nyoung_modulus_pa = {:.9g}\n"
             "poisson_ratio = {:.9g}\naveraged_strain = {}\n\n[run]\nmode = \"static\"\n"
             "seconds = 1\nload_steps = 2\nover_relaxation = 1.8\ntolerance_n = {}\n"
             "max_sweeps = 20000\n\n",
             pressed.young_pa, pressed.poisson, is_averaged, pressed.tolerance_n) +
         near_set("patch", to_double(place.position) * 1e3, pressed.patch_mm, true) +
         displace("patch", {{0, {}}, {1, to_double(place.outward) * -pressed.depth_mm}}) +
         "[[probe]]\nset = \"patch\"\nquantity = \"reaction\"\n";
}

// Places whose patch has no fixed node.
std::vector<calibration::Place> places_of(const PressedOrgan& pressed, std::size_t count) {
  auto places = calibration::spread_places(pressed.organ, 4 * count, kPlacesSeed);
  std::erase_if(places, [&](const calibration::Place& place) {
    return std::ranges::any_of(pressed.organ.fixed_nodes, [&](NodeIndex node) {
      const auto& p = pressed.organ.mesh.rest_positions[node.value];
      return length(p - to_double(place.position)) <= pressed.patch_mm * 1e-3;
    });
  });
  places.resize(std::min(places.size(), count));
  return places;
}

struct Errors {
  double mean = 0, at_95 = 0, worst = 0;
};
Errors errors_of(std::vector<double> errors) {
  std::ranges::sort(errors);
  const auto last = errors.size() - 1;
  const auto at_95 = static_cast<std::size_t>(std::ceil(0.95 * static_cast<double>(last)));
  return {std::accumulate(errors.begin(), errors.end(), 0.0) / static_cast<double>(errors.size()),
          errors[at_95], errors[last]};
}

void measure_presses(const Lab& lab, Section& section, const PressedOrgan& pressed, Table& table) {
  lab.keep_organ(fmt::format("presses-{}", pressed.name), pressed.organ);
  const auto places = places_of(pressed, lab.is_short() ? 2 : 6);
  std::vector<double> averaged_errors;
  for (std::size_t i = 0; i < places.size(); ++i) {
    show_progress(fmt::format("{}, place {}", pressed.name, i + 1));
    const auto off_line = [&](ElementOrder order) {
      return length(probe_off_line(lab, patch_text(pressed, places[i], false), order));
    };
    const double quadratic = off_line(ElementOrder::Quadratic),
                 linear = off_line(ElementOrder::Linear);
    const auto run = lab.start(section, "a patch of an organ pressed in",
                               fmt::format("presses-{}-{}", pressed.name, i + 1),
                               patch_text(pressed, places[i], true));
    lab.finish(section, *run);
    const double averaged = length(run->probe(0));
    averaged_errors.push_back(std::abs(averaged / quadratic - 1));
    const auto off = [&](double value) { return shown_percent(value / quadratic - 1); };
    table.rows.push_back({pressed.title, std::to_string(i + 1), shown(quadratic), shown(averaged),
                          off(averaged), shown(linear), off(linear)});
  }
  const auto errors = errors_of(averaged_errors);
  const auto bound = [](double on_record) {
    const auto aim = target(kPressTarget, "5 % of a converged press");
    return on_record > 0 ? aim.missed(on_record) : aim;
  };
  section.at_most(fmt::format("{}-mean", pressed.name), "quadratic elements", errors.mean,
                  bound(pressed.mean_on_record), "Mean error of the force over the presses.");
  section.at_most(fmt::format("{}-worst", pressed.name), "quadratic elements", errors.worst,
                  bound(pressed.worst_on_record), "Largest error of the force of a press.");
  section.measured(fmt::format("{}-95", pressed.name), shown_percent(errors.at_95),
                   "95th percentile of these errors.");
}

}  // namespace

void run_presses(const Lab& lab, Section& section) {
  section.say(
      "A patch of each organ is pressed in at places that are spread over it, in the neo-Hookean "
      "law, and held. The live solver averages strain, as sessions do by default; linear tets "
      "without averaging are the off-line solver's. Quadratic elements of the same mesh are the "
      "reference.");
  Table table{"The force of each press, N",
              {"organ", "place", "quadratic", "averaged strain", "off", "plain linear tets", "off"},
              {}};
  for (const auto& pressed : pressed_organs(lab)) measure_presses(lab, section, pressed, table);
  section.add(std::move(table));
}

}  // namespace trocar::validation
