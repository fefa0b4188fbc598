#include "server/lab/scenario/probe_plots.h"

#include "common/plot/plot.h"

namespace trocar::scenario {
namespace {

using scenario::ProbeQuantity;

struct Drawn {
  const char* label;
  double per_si;
};

Drawn drawn(ProbeQuantity quantity) {
  switch (quantity) {
    case ProbeQuantity::Displacement:
      return {"displacement (mm)", 1e3};
    case ProbeQuantity::Velocity:
      return {"velocity (mm/s)", 1e3};
    case ProbeQuantity::Reaction:
      return {"reaction (N)", 1};
    case ProbeQuantity::ToolForce:
      return {"force on the tool (N)", 1};
    case ProbeQuantity::StartForce:
    case ProbeQuantity::EndForce:
      return {"force of the thread (N)", 1};
  }
  return {"", 1};
}

std::string subject(const scenario::ProbeRule& probe) {
  if (probe.set) return "set " + probe.set->name;
  return probe.thread ? "thread " + std::to_string(*probe.thread)
                      : "tool " + std::to_string(*probe.tool);
}

}  // namespace

ProbePlots::ProbePlots(const ScenarioRun& run)
    : curves_(load_curves(run.resolved())),
      samples_(run.scenario().probes.size()),
      points_(curves_.size()) {}

void ProbePlots::add(const ScenarioRun& run) {
  for (std::size_t i = 0; i < samples_.size(); ++i)
    if (run.is_due(i)) samples_[i].add({run.time_s(), run.probe(i)});
  for (std::size_t i = 0; i < curves_.size(); ++i)
    if (run.is_due(curves_[i].probe)) points_[i].add(load_point(run, curves_[i]));
}

Status ProbePlots::write(const std::filesystem::path& folder, const ScenarioRun& run) const {
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    const auto& probe = run.scenario().probes[i];
    const auto [label, per_si] = drawn(probe.quantity);
    plot::Plot plot{.title = run.scenario().source.stem().string() + ": " + subject(probe)};
    plot.x.label = "time (s)";
    plot.y.label = label;
    plot.series = {{"x", {}, {}, {}, {}},
                   {"y", {}, {}, {}, {}},
                   {"z", {}, {}, {}, {}},
                   {"magnitude", {}, {}, plot::Style::Dashed, 6}};
    for (const auto& [time, value] : samples_[i].kept()) {
      const Vec3d v = value * per_si;
      const std::array<double, 4> parts{v.x, v.y, v.z, length(v)};
      for (std::size_t k = 0; k < parts.size(); ++k) {
        plot.series[k].x.push_back(time);
        plot.series[k].y.push_back(parts[k]);
      }
    }
    if (samples_[i].kept().empty()) continue;
    if (auto s = plot::write_svg(folder / ("probe_" + probe.name + ".svg"), plot); !s) return s;
  }
  for (std::size_t i = 0; i < curves_.size(); ++i) {
    plot::Plot plot{.title = run.scenario().source.stem().string() + ": force on " +
                             curves_[i].name + " against its displacement"};
    plot.x.label = "displacement (mm)";
    plot.y.label = "force (N)";
    plot.series.push_back({"", {}, {}, plot::Style::LineAndPoints, {}});
    for (const auto& [displacement, force] : points_[i].kept()) {
      plot.series[0].x.push_back(displacement * 1e3);
      plot.series[0].y.push_back(force);
    }
    if (points_[i].kept().empty()) continue;
    if (auto s = plot::write_svg(folder / ("force_" + curves_[i].name + ".svg"), plot); !s)
      return s;
  }
  return {};
}

}  // namespace trocar::scenario
