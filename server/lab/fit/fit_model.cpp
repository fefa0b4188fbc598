#include "server/lab/fit/fit_model.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "server/lab/scenario/scenario_run.h"
#include "server/organs/material/material_keys.h"

namespace trocar::fit {
namespace {

using material::ElasticLaw;
using material::Material;

constexpr std::array kTunables{
    Tunable{"young_modulus_pa", &Material::young_modulus_pa, 1, 1e12, 0.02, false},
    Tunable{"spring_stiffness_n_m", &Material::spring_stiffness_n_m, 1e-3, 1e9, 0.02, false},
    Tunable{"poisson_ratio", &Material::poisson_ratio, 0, 0.4999, 0.005, true},
    Tunable{"fibre_stiffness_ratio", &Material::fibre_stiffness_ratio, 1e-3, 1000, 0.05, false},
    Tunable{"tension", &Material::tension, 0, 0.9, 0.002, true},
    Tunable{"node_damping_per_s", &Material::node_damping_per_s, 1e-3, 1e6, 0.05, false},
    Tunable{"edge_damping_time_s", &Material::edge_damping_time_s, 1e-6, 100, 0.05, false}};

Error wrong(const scenario::ResolvedScenario& resolved, const std::string& what) {
  return {ErrorCode::BadFile, resolved.scenario.source.string() + ": " + what};
}

// A key that changes nothing cannot be fitted.
std::string why_not(const Tunable& tunable, const Material& m, bool has_fibres, bool is_static) {
  const bool is_springs = m.elastic_law == ElasticLaw::Springs;
  const bool is_constant = is_springs && m.spring_law == material::SpringLaw::Constant;
  if (tunable.key == "young_modulus_pa" && is_constant)
    return "its springs have a given stiffness, fit spring_stiffness_n_m";
  if (const auto why = material::why_not_with(tunable.key, m.elastic_law); !why.empty())
    return m.elastic_law == ElasticLaw::Measured
               ? "a measured material has constants of its own, see trocar-organ identify"
               : "it " + std::string(why);
  if (tunable.key == "spring_stiffness_n_m" && !is_constant)
    return "its stiffness comes from young_modulus_pa, fit that";
  if (tunable.key == "fibre_stiffness_ratio" && !has_fibres)
    return "it needs a fibre_direction in [material]";
  if (is_static && tunable.key.find("damping") != std::string_view::npos)
    return "a static run has no damping, make it dynamic";
  return "";
}

struct Sample {
  double at, force_n;
};

// `samples` by increasing `at`; constant outside.
double interpolated(const std::vector<Sample>& samples, double at) {
  const auto after = std::ranges::lower_bound(samples, at, {}, &Sample::at);
  if (after == samples.begin()) return samples.front().force_n;
  if (after == samples.end()) return samples.back().force_n;
  const auto before = after - 1;
  return before->force_n +
         (after->force_n - before->force_n) * (at - before->at) / (after->at - before->at);
}

}  // namespace

std::span<const Tunable> tunables() {
  return kTunables;
}

Result<FitModel> FitModel::create(const scenario::ResolvedScenario& resolved,
                                  const MeasuredCurve& measured, const FitOptions& options) {
  FitModel model;
  model.resolved_ = resolved;
  model.measured_ = &measured;
  model.solver_ = options.solver;
  if (auto s = scenario::check_supported(resolved); !s) return s.error();
  if (auto s = model.choose_curve(options); !s) return s.error();
  if (auto s = model.choose_parameters(options); !s) return s.error();
  if (auto s = model.place_measurements(); !s) return s.error();
  return model;
}

Status FitModel::choose_curve(const FitOptions& options) {
  auto curves = scenario::load_curves(resolved_);
  std::erase_if(curves,
                [](const auto& c) { return c.kind == scenario::LoadCurve::Kind::LoadedSet; });
  std::string names;
  for (const auto& curve : curves) names += (names.empty() ? "" : ", ") + curve.name;
  if (!options.curve.empty())
    std::erase_if(curves, [&](const auto& c) { return c.name != options.curve; });
  if (names.empty())
    return wrong(resolved_,
                 "has no force-displacement curve: probe the \"reaction\" of a displaced "
                 "set, or the \"force\" of a tool that moves");
  if (curves.size() != 1)
    return wrong(resolved_, "has the force-displacement curves " + names +
                                ": choose one of them with --curve");
  curve_ = curves.front();
  return {};
}

Status FitModel::choose_parameters(const FitOptions& options) {
  const auto& regions = resolved_.organ.regions;
  if (!options.region.empty()) {
    const auto found = std::ranges::find(regions, options.region, &material::MaterialRegion::name);
    if (found == regions.end())
      return wrong(resolved_, "has no region \"" + options.region + "\", see --region");
    region_ = static_cast<std::size_t>(found - regions.begin());
  }
  const bool is_static = resolved_.scenario.run.mode == scenario::RunMode::Static;
  const Material& m = material();
  const bool has_fibres =
      length(m.fibre_direction) > 0 || !resolved_.organ.fibre_directions.empty();
  std::vector<std::string> keys = options.parameters;
  if (keys.empty()) {
    const bool is_constant =
        m.elastic_law == ElasticLaw::Springs && m.spring_law == material::SpringLaw::Constant;
    keys = {is_constant ? "spring_stiffness_n_m" : "young_modulus_pa"};
  }
  for (const auto& key : keys) {
    const auto found = std::ranges::find(kTunables, key, &Tunable::key);
    if (found == kTunables.end())
      return Error{ErrorCode::Usage,
                   "parameter '" + key + "' cannot be fitted, write one of " + fit_keys()};
    if (std::ranges::find(parameters_, found->key, &Tunable::key) != parameters_.end())
      return Error{ErrorCode::Usage, "parameter '" + key + "' is there twice, remove one"};
    if (const auto why = why_not(*found, m, has_fibres, is_static); !why.empty())
      return wrong(resolved_, key + " cannot be fitted here: " + why);
    if (!(m.*found->member > 0) && !found->is_bounded)
      return wrong(resolved_, key + " is 0, give it a value to start from");
    parameters_.push_back(*found);
    // Both shorten tissue along its fibres, by at most this together.
    if (key == "tension") parameters_.back().high -= m.fibre_tension;
    if (parameters_.back().high - parameters_.back().low < found->step)
      return wrong(resolved_, key + " cannot be fitted here: fibre_tension leaves it no room");
  }
  if (measured_->points.size() < parameters_.size())
    return Error{ErrorCode::BadFile, measured_->source.string() +
                                         ": has fewer measurements than "
                                         "there are numbers to fit"};
  return {};
}

Error FitModel::no_effect(std::size_t parameter) const {
  const auto& organ = resolved_.organ;
  const std::string what =
      "the curve does not depend on " + std::string(parameters_[parameter].key);
  const auto map = organ::material_map(organ);
  const auto& used = map.tets.empty() ? map.spring_pairs : map.tets;
  const auto index = static_cast<std::uint16_t>(region_ ? *region_ + 1 : 0);
  if (std::ranges::find(used, index) == used.end() && !region_) {
    std::string names;
    for (const auto& region : organ.regions) names += (names.empty() ? "" : ", ") + region.name;
    return wrong(resolved_, what +
                                " of the organ's own material: all tissue is in regions, say "
                                "--region with one of " +
                                names);
  }
  return wrong(resolved_, what + (region_ ? " of region " + organ.regions[*region_].name : "") +
                              ": the probe does not feel it, so probe nearer, start from a larger "
                              "value, or fit another parameter");
}

double FitModel::displacement_at(double time_s) const {
  const auto& scenario = resolved_.scenario;
  if (curve_.kind == scenario::LoadCurve::Kind::DisplacedSet)
    return dot(scenario.displacements[curve_.load].over_time.at(time_s), curve_.direction);
  const auto tip = [&](double t) {
    return to_double(tool::sample(scenario.tools[curve_.load], t, resolved_.anchors[curve_.load])
                         .world_from_tool.position);
  };
  return dot(tip(time_s) - tip(0), curve_.direction);
}

// Static: the load steps become the times at which the scenario is first where it was measured.
Status FitModel::place_measurements() {
  auto& run = resolved_.scenario.run;
  constexpr int kPieces = 1000;
  double most = displacement_at(0);
  for (int i = 1; i <= kPieces; ++i)
    most = std::max(most, displacement_at(run.seconds * i / kPieces));
  const auto at_line = [&](const Measurement& point, const std::string& what) {
    return Error{ErrorCode::BadFile,
                 measured_->source.string() + ":" + std::to_string(point.line) + ": " + what};
  };
  std::vector<double> times;
  for (const auto& point : measured_->points) {
    const bool by_time = measured_->has_times && run.mode == scenario::RunMode::Dynamic;
    if (by_time && (point.time_s < 0 || point.time_s > run.seconds))
      return at_line(point, "the scenario is from 0 to " + std::to_string(run.seconds) +
                                " s: lengthen it, or remove the row");
    char text[160];
    std::snprintf(
        text, sizeof text,
        "displacement %g mm is not among the scenario's, %g to %g mm: lengthen its motion, "
        "or remove the row",
        point.displacement_m * 1e3, displacement_at(0) * 1e3, most * 1e3);
    if (!by_time &&
        !(point.displacement_m <= most + 1e-9 && point.displacement_m >= displacement_at(0) - 1e-9))
      return at_line(point, text);
    // The first piece in which it is passed, then bisection.
    double low = 0, high = 0;
    for (int i = 0; i <= kPieces; ++i) {
      low = high;
      high = run.seconds * i / kPieces;
      if (displacement_at(high) >= point.displacement_m - 1e-12) break;
    }
    for (int i = 0; i < 40; ++i) {
      const double middle = (low + high) / 2;
      (displacement_at(middle) >= point.displacement_m ? high : low) = middle;
    }
    times.push_back(high);
  }
  if (run.mode != scenario::RunMode::Static) return {};
  run.load_times_s = times;
  std::ranges::sort(run.load_times_s);
  run.load_times_s.erase(std::unique(run.load_times_s.begin(), run.load_times_s.end()),
                         run.load_times_s.end());
  for (const double time : times)
    steps_.push_back(static_cast<std::size_t>(std::ranges::lower_bound(run.load_times_s, time) -
                                              run.load_times_s.begin()));
  return {};
}

organ::Organ FitModel::organ(std::span<const double> values) const {
  organ::Organ organ = resolved_.organ;
  Material& m = region_ ? organ.regions[*region_].material : organ.material;
  for (std::size_t i = 0; i < parameters_.size(); ++i) m.*parameters_[i].member = values[i];
  return organ;
}

FitModel::Forces FitModel::run(std::span<const double> values) const {
  scenario::ResolvedScenario changed = resolved_;
  changed.organ = organ(values);
  scenario::ScenarioRun run(std::move(changed), solver_);
  const bool is_static = run.scenario().run.mode == scenario::RunMode::Static;
  const bool by_time = !is_static && measured_->has_times;
  Forces result;
  std::vector<Sample> samples;
  while (!run.is_finished()) {
    result.is_converged &= run.step().is_converged;
    if (!run.is_due(curve_.probe)) continue;
    const auto [displacement, force] = scenario::load_point(run, curve_);
    if (!std::isfinite(force)) return {{}, false};
    const double at = is_static ? static_cast<double>(samples.size())
                      : by_time ? run.time_s()
                                : displacement;
    if (samples.empty() || at > samples.back().at) samples.push_back({at, force});
  }
  if (samples.empty()) return {{}, false};
  for (std::size_t i = 0; i < measured_->points.size(); ++i)
    result.forces_n.push_back(interpolated(samples, is_static ? static_cast<double>(steps_[i])
                                                    : by_time
                                                        ? measured_->points[i].time_s
                                                        : measured_->points[i].displacement_m));
  return result;
}

}  // namespace trocar::fit
