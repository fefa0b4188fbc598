// The local reduction beside the full model, and beside Dogan 2011's eight modes under the same
// loads: errors at places of the training and between them, what a step costs, and what making it
// does.

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "common/base/timing.h"
#include "server/lab/reduce/local_quality.h"
#include "server/organs/organ/local_reduction_file.h"
#include "server/papers/dogan/quality.h"
#include "tests/validation/experiments.h"
#include "tests/validation/measured_livers.h"

namespace trocar::validation {
namespace {

using namespace reduce;

// Targets: means at trained places, and anywhere. The short form's liver is coarse: its nodes are
// 13 mm apart, where a force on one of them is harder to follow.
constexpr double kTrainedField = 0.02, kTrainedForce = 0.01, kUnseenField = 0.04,
                 kUnseenForce = 0.03;
constexpr std::size_t kDoganModes = 8;

// Two free layers, and one: nearer, and faster.
constexpr std::array<std::uint32_t, 2> kFreeLayers{2, 1};

LocalSettings local_settings_of(const Lab& lab) {
  LocalSettings settings{.patches = 10, .threads = 2};
  if (lab.is_short())
    settings.modes = 16, settings.directions = 2, settings.field_nodes = 5, settings.patches = 2,
    settings.patch_radius_m = 0.02;
  return settings;
}

class LocalStudy {
 public:
  LocalStudy(const Lab& lab, Section& section, const MeasuredLiver& liver)
      : section_(section),
        liver_(liver),
        is_short_(lab.is_short()),
        settings_(local_settings_of(lab)) {
    auto model = FullModel::create(liver.organ);
    TROCAR_ASSERT(model.ok());
    model_ = std::move(*model);
  }

  void run() {
    Table errors{fmt::format("Mean (95th percentile, worst) error: {}", liver_.title),
                 {"model", "loads", "L2", "displacement of the contact", "force on it"},
                 {}};
    Table costs{fmt::format("What it costs: {}", liver_.title),
                {"model", "unknowns", "tets", "step, median", "worst", "Newton steps, factors",
                 "made in", "file"},
                {}};
    for (const auto layers : kFreeLayers) show(layers, errors, costs);
    show_dogan(errors);
    section_.add(std::move(errors));
    section_.add(std::move(costs));
    section_.add(std::move(plot_));
  }

 private:
  void show(std::uint32_t layers, Table& errors, Table& costs) {
    settings_.free_layers = layers;
    const auto begin = monotonic_ns();
    auto made = build_local(
        liver_.organ, settings_, [&](LocalStage stage, std::size_t done, std::size_t all) {
          show_progress(fmt::format("{}, {} free layers: stage {}, {} of {}", liver_.name, layers,
                                    static_cast<int>(stage) + 1, done, all));
        });
    const double seconds = static_cast<double>(monotonic_ns() - begin) * 1e-9;
    TROCAR_ASSERT(made.ok());
    if (loads_.empty())
      loads_ = solve_local_loads(*model_, *made, is_short_ ? 2 : 8, is_short_ ? 4 : 16);
    const auto& r = made->reduction;
    const auto trained = errors_of_local(r, liver_.organ, loads_, true),
               unseen = errors_of_local(r, liver_.organ, loads_, false);
    const auto name = fmt::format("ours, {} free layer{}", layers, layers == 1 ? "" : "s");
    add_row(errors, name, "of trained places", trained);
    add_row(errors, name, "8 mm or more off", unseen);
    const auto pairs = errors_of_pairs(*model_, r, loads_, is_short_ ? 3 : 12);
    add_row(errors, name, "two tools", pairs);
    add_series(name, unseen.field, static_cast<int>(2 - layers));
    std::vector<double> medians, worsts, iterations, factors;
    for (const auto& load : loads_) {
      const auto rate = rate_of_local(r, liver_.organ, load.press);
      medians.push_back(rate.median_us), worsts.push_back(rate.worst_us);
      iterations.push_back(rate.iterations), factors.push_back(rate.factors);
    }
    const auto mean = [](const std::vector<double>& v) {
      return std::accumulate(v.begin(), v.end(), 0.0) / static_cast<double>(v.size());
    };
    const auto& z = unseen.largest;
    const auto file = organ::pack_local_reduction(r);
    TROCAR_ASSERT(file.ok());
    costs.rows.push_back({name, std::to_string(z.unknowns()),
                          fmt::format("{} + {} weighted", z.inner_tets, z.cubature_tets),
                          fmt::format("{} us", shown(mean(medians))),
                          fmt::format("{} us", shown(*std::ranges::max_element(worsts))),
                          fmt::format("{}, {}", shown(mean(iterations)), shown(mean(factors))),
                          fmt::format("{} s for {} patches", shown(seconds), r.patches.size()),
                          fmt::format("{} MB", shown(static_cast<double>(file->size()) * 1e-6))});
    section_.exactly(this->name(layers, "solved"), "0",
                     std::to_string(trained.unsolved + unseen.unsolved + pairs.unsolved),
                     target(0, "every load is solved"),
                     "Loads for which the reduced model finds no equilibrium.");
    if (layers != kFreeLayers.front()) return;
    const auto at_most = [&](const char* what, const std::vector<double>& values, double bound,
                             const char* of) {
      section_.at_most(this->name(layers, what), shown_percent(bound), errors_of(values).mean,
                       target(bound, "near the full model"), of);
    };
    at_most("trained-field", trained.field, kTrainedField, "L2 at trained places, mean.");
    at_most("trained-force", trained.force, kTrainedForce,
            "Force on the contact at trained places, mean.");
    at_most("unseen-field", unseen.field, kUnseenField, "L2 elsewhere, mean.");
    at_most("unseen-force", unseen.force, kUnseenForce, "Force on the contact elsewhere, mean.");
    at_most("two-tools", pairs.field, kUnseenField, "L2 under two tools, mean.");
  }

  // The paper's method on the same places, for the same loads.
  void show_dogan(Table& errors) {
    using namespace dogan;
    dogan::Settings settings{.modes = kDoganModes, .places = 30, .magnitudes = 2, .radius_m = 0};
    if (is_short_) settings.places = 8, settings.directions = 2, settings.tangents = 8;
    const auto training = train(*model_, settings, [&](Stage, std::size_t done, std::size_t all) {
      show_progress(fmt::format("{}, eight modes: {} of {}", liver_.name, done, all));
    });
    const auto built = dogan::reduce(*model_, training, settings);
    TROCAR_ASSERT(built.ok());
    std::vector<Unseen> loads;
    for (const auto& load : loads_)
      if (!load.is_trained) loads.push_back({load.press, load.displacements});
    const auto quality = quality_of(built->reduction, liver_.organ, loads);
    for (const bool is_best : {false, true}) {
      const auto& q = is_best ? quality.best : quality.initial;
      errors.rows.push_back(
          {fmt::format("Dogan's, 8 modes, {} tangent", is_best ? "best" : "initial"),
           "8 mm or more off", text_of(q.field), text_of(q.contact), ""});
      if (is_best) add_series("Dogan's, 8 modes, best tangent", q.field_errors, 2);
    }
  }

  static std::string text_of(const Errors& e) {
    return fmt::format("{} ({}, {})", shown_percent(e.mean), shown_percent(e.high),
                       shown_percent(e.worst));
  }
  static void add_row(Table& table, const std::string& model, const char* where,
                      const LocalErrors& errors) {
    table.rows.push_back({model, fmt::format("{} {}", errors.field.size(), where),
                          text_of(errors_of(errors.field)), text_of(errors_of(errors.contact)),
                          errors.force.empty() ? "" : text_of(errors_of(errors.force))});
  }
  void add_series(const std::string& title, std::vector<double> values, int colour) {
    if (plot_.series.empty()) {
      plot_.title = fmt::format("Loads 8 mm or more off the training, each model's in order: {}",
                                liver_.title);
      plot_.x = {"load", false, {}, {}};
      plot_.y = {"L2 error, %", true, {}, {}};
    }
    std::ranges::sort(values);
    plot::Series series{title, {}, {}, plot::Style::LineAndPoints, colour};
    for (std::size_t i = 0; i < values.size(); ++i) {
      series.x.push_back(static_cast<double>(i + 1));
      series.y.push_back(100 * values[i]);
    }
    plot_.series.push_back(std::move(series));
  }
  std::string name(std::uint32_t layers, const char* what) const {
    return fmt::format("{}-{}-layers-{}", liver_.name, layers, what);
  }

  Section& section_;
  const MeasuredLiver& liver_;
  const bool is_short_;
  LocalSettings settings_;
  std::unique_ptr<FullModel> model_;
  std::vector<LocalLoad> loads_;
  plot::Plot plot_;
};

}  // namespace

void run_local_reduction(const Lab& lab, Section& section) {
  const auto settings = local_settings_of(lab);
  section.say(fmt::format(
      "Patches of {} mm beside each other, {} of them, each with {} modes, the fields of unit "
      "forces "
      "on its nodes, and the nodes around a touched one free. Training: the patches' centres, {} "
      "directions, up to {} N on a single node. Loads: other directions, 0.3 and 0.85 of the "
      "force, "
      "at the centres and at nodes at least 8 mm from all of them. At once, linear tets. The force "
      "on "
      "the contact is that on the node where it is held at the full model's place. A step is one "
      "of "
      "a hundred of a growing press, each solved from the one before, thread CPU time. Dogan's "
      "eight "
      "modes are of presses of single nodes all over the organ.",
      1e3 * settings.patch_radius_m, settings.patches, settings.modes, settings.directions,
      settings.force_n));
  for (const auto& liver : measured_livers(lab)) LocalStudy(lab, section, liver).run();
}

}  // namespace trocar::validation
