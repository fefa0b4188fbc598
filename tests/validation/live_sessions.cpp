#include "tests/validation/live_sessions.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "common/base/assert.h"
#include "common/base/timing.h"
#include "server/lab/reduce/local_quality.h"
#include "server/lab/reduce/presses.h"
#include "server/organs/organ/local_reduction_file.h"
#include "server/tissue/reduction/reduced_tissue.h"
#include "tests/validation/lab.h"

namespace trocar::validation {
namespace {

constexpr float kLift_m = 0.010f;  // above the surface at the end
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

Vec3d force_in(const step::Simulation& simulation) {
  Vec3d force;
  const auto& contacts = simulation.context().contact.found;
  for (const auto& tool : contacts.tools)
    if (tool.tool == tool_slot({0}, 0))
      force += to_double(contact::reaction_on(contacts, tool, simulation.state().world).force_n);
  return force;
}

LivePlace place_at(const organ::Organ& organ, const LiveReduction& reduction,
                   const std::vector<Vec3d>& normals, NodeIndex node, std::uint32_t patch) {
  const auto& x = organ.mesh.rest_positions;
  LivePlace place{.node = node, .patch = patch};
  place.is_trained = std::ranges::find(reduction.pressed, node) != reduction.pressed.end();
  place.position = to_float(x[node.value]);
  place.outward = to_float(normals[node.value]);
  Vec3d middle;
  for (const auto& p : reduction.local->patches) middle += x[p.centre.value];
  middle = middle * (1.0 / static_cast<double>(reduction.local->patches.size()));
  Vec3f way = to_float(middle - x[node.value]);
  way -= place.outward * dot(place.outward, way);
  place.inward = length(way) > 1e-4f ? way * (1 / length(way))
                                     : rotate(rotation_from_z(place.outward), {1, 0, 0});
  return place;
}

}  // namespace

LiveReduction make_live_reduction(const std::string& name, const organ::Organ& organ,
                                  const reduce::LocalSettings& settings) {
  const auto begin = monotonic_ns();
  auto made = reduce::build_local(
      organ, settings, [&](reduce::LocalStage stage, std::size_t done, std::size_t all) {
        show_progress(fmt::format("{}: reduction, stage {}, {} of {}", name,
                                  static_cast<int>(stage) + 1, done, all));
      });
  const double seconds = static_cast<double>(monotonic_ns() - begin) * 1e-9;
  TROCAR_ASSERT(made.ok());
  const auto file = organ::pack_local_reduction(made->reduction);
  TROCAR_ASSERT(file.ok());
  return {std::make_shared<organ::LocalReduction>(std::move(made->reduction)),
          std::move(made->pressed), seconds, file->size()};
}

std::vector<LivePlace> live_places(const organ::Organ& organ, const LiveReduction& reduction,
                                   std::size_t trained, std::size_t unseen) {
  const auto& x = organ.mesh.rest_positions;
  const auto normals = mesh::surface_normals(organ.mesh);
  const auto& patches = reduction.local->patches;
  std::vector<NodeIndex> far;
  for (const auto& patch : patches)
    for (const auto node : patch.members)
      if (std::ranges::none_of(reduction.pressed, [&](NodeIndex pressed) {
            return length(x[pressed.value] - x[node.value]) < reduce::kFarFromTraining_m;
          }))
        far.push_back(node);
  const auto patch_of = [&](NodeIndex node) {
    const auto found = std::ranges::find_if(patches, [&](const organ::LocalPatch& patch) {
      return std::ranges::find(patch.members, node) != patch.members.end();
    });
    return static_cast<std::uint32_t>(found - patches.begin());
  };
  std::vector<LivePlace> places;
  for (const auto node : reduce::spread_nodes(organ, reduction.pressed, trained, 0))
    places.push_back(place_at(organ, reduction, normals, node, patch_of(node)));
  for (const auto node : reduce::spread_nodes(organ, far, unseen, 0))
    places.push_back(place_at(organ, reduction, normals, node, patch_of(node)));
  return places;
}

std::vector<LivePlace> places_of_patch(const organ::Organ& organ, const LiveReduction& reduction,
                                       std::uint32_t patch, std::size_t count) {
  const auto normals = mesh::surface_normals(organ.mesh);
  const auto& p = reduction.local->patches[patch];
  std::vector<NodeIndex> nodes{p.centre};
  const std::array taken{p.centre};
  if (count > 1)
    for (const auto node : reduce::spread_nodes(organ, p.members, count - 1, 0, taken))
      if (node != p.centre) nodes.push_back(node);
  std::vector<LivePlace> places;
  for (const auto node : nodes) places.push_back(place_at(organ, reduction, normals, node, patch));
  return places;
}

Tick Stroke::down_ticks() const {
  return static_cast<Tick>(std::ceil((above_m + depth_m) / speed_m_s / kTickSeconds));
}
Tick Stroke::lift_ticks() const {
  return free_ticks == 0
             ? 0
             : static_cast<Tick>(std::ceil((kLift_m + depth_m) / speed_m_s / kTickSeconds));
}

hands::TickInputs Stroke::at(Tick tick) const {
  hands::TickInputs inputs;
  if (tick == 1) {
    hands::HandJoin join{.slot = {0}};
    join.shapes[0] = {.radius_m = radius_m, .length_m = 0.3f, .reach_m = 0.012f};
    inputs.joins.push_back(join);
  }
  const Tick down = down_ticks(), slides = down + hold_ticks, lifts = slides + slide_ticks;
  const auto seconds_since = [&](Tick begin) {
    return tick > begin ? static_cast<float>(tick - begin) * kTickSeconds : 0.0f;
  };
  const float way = std::min(above_m + depth_m, speed_m_s * seconds_since(0));
  float height = above_m - way;
  if (lift_ticks() > 0 && tick > lifts)
    height = std::min(kLift_m, height + speed_m_s * seconds_since(lifts));
  const float slid =
      slide_ticks > 0
          ? std::min(1.0f, seconds_since(slides) / (static_cast<float>(slide_ticks) * kTickSeconds))
          : 0.0f;
  const Vec3f tip =
      place.position + place.outward * height + aside * (slant * way + slide_m * slid);
  inputs.samples.push_back(
      {tool_slot({0}, 0), {{tip, rotation_from_z(place.outward)}, tool::Verb::Push}});
  return inputs;
}

double Course::largest_force_n() const {
  double most = 0;
  for (const auto& tick : ticks) most = std::max(most, length(tick.force_n));
  return most;
}

Script script_of(const Stroke& stroke) {
  return {stroke.ticks(), [stroke](Tick tick) { return stroke.at(tick); }, {}};
}

Course run_session(const organ::Organ& organ,
                   const std::shared_ptr<const organ::LocalReduction>& reduction,
                   const Script& script, Tick field_ticks) {
  step::Simulation simulation(organ, 1, reduction::at_work(reduction));
  Course course;
  course.field_ticks = std::max<Tick>(1, field_ticks);
  for (Tick tick = 1; tick <= script.ticks; ++tick) {
    const auto inputs = script.inputs(tick);
    const auto decisions = script.decisions ? script.decisions(tick) : step::TickDecisions{};
    const auto begin = thread_cpu_ns();
    const auto& report = simulation.tick(inputs, decisions);
    const auto cpu_ns = thread_cpu_ns() - begin;
    simulation.pop_frame();
    course.convergence.note(report, decisions);
    LiveTick now{.force_n = force_in(simulation),
                 .us = static_cast<double>(cpu_ns) * 1e-3,
                 .is_reduced = report.solve.figures.is_reduced()};
    if (const auto* const model = simulation.state().far_model.get()) {
      now.figures = model->figures();
      now.estimate = static_cast<const reduction::ReducedTissue&>(*model).state().far.estimate;
    }
    course.pilot.note(report, length(now.force_n));
    if (course.lost == 0 &&
        (report.solve.nodes_rejected > 0 || !std::isfinite(length(now.force_n))))
      course.lost = tick;
    course.ticks.push_back(now);
    if (field_ticks > 0 && tick % field_ticks == 0) {
      const auto& u = simulation.state().world.displacements;
      course.fields.emplace_back(u.begin(), u.begin() + organ.mesh.node_count());
    }
  }
  return course;
}

Course References::run(const organ::Organ& organ, Script script, Tick field_ticks) {
  script.decisions = calibration::Pilot::decisions;
  const auto pilot = run_session(organ, nullptr, script, 0).pilot;
  const auto converged = [&](double looser, Tick fields) {
    const auto tolerance = pilot.tolerance_n(organ.mesh.node_count(), looser);
    script.decisions = [=](Tick) { return calibration::converged_decisions(tolerance); };
    return run_session(organ, nullptr, script, fields);
  };
  auto course = converged(1, field_ticks);
  const double largest = course.largest_force_n();
  if (largest < kLeastForce_n) return course;
  const auto loose = converged(calibration::kLooser, 0);
  for (std::size_t i = 0; i < course.ticks.size(); ++i)
    own_error_ =
        std::max(own_error_, length(loose.ticks[i].force_n - course.ticks[i].force_n) / largest);
  convergence_.add(course.convergence);
  ++count_;
  return course;
}

void References::check(Section& section, const std::string& name, Bound own_error) const {
  check_reference(section, name, convergence_, count_ > 0 ? own_error_ : kNone,
                  std::move(own_error));
}

double force_error(const Course& course, const Course& reference, std::size_t tick) {
  if (course.lost != 0 && tick + 1 >= course.lost) return std::numeric_limits<double>::infinity();
  const auto& expected = reference.ticks[tick].force_n;
  return length(course.ticks[tick].force_n - expected) / length(expected);
}

double field_error(const Course& course, const Course& reference, std::size_t field) {
  if (course.lost != 0 && (field + 1) * course.field_ticks >= course.lost)
    return std::numeric_limits<double>::infinity();
  double difference = 0, whole = 0;
  const auto& expected = reference.fields[field];
  for (std::size_t n = 0; n < expected.size(); ++n) {
    difference += static_cast<double>(length_squared(course.fields[field][n] - expected[n]));
    whole += static_cast<double>(length_squared(expected[n]));
  }
  return std::sqrt(difference / whole);
}

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return kNone;
  const auto at = static_cast<std::size_t>(std::min(
      std::ceil(share * static_cast<double>(values.size())), static_cast<double>(values.size())));
  std::ranges::sort(values);
  return values[at == 0 ? 0 : at - 1];
}

double mean(const std::vector<double>& values) {
  if (values.empty()) return kNone;
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

std::string shown_errors(const std::vector<double>& errors) {
  return fmt::format("{} ({}, {})", shown_percent(mean(errors)),
                     shown_percent(quantile(errors, 0.95)), shown_percent(quantile(errors, 1)));
}

}  // namespace trocar::validation
