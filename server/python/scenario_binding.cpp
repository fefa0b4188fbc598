#include "server/python/scenario_binding.h"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <optional>
#include <vector>

#include "server/lab/scenario/scenario_run.h"
#include "server/organs/organ/organ.h"
#include "server/python/arrays.h"
#include "server/python/errors.h"
#include "server/python/interruptible.h"

namespace trocar::python {
namespace {

namespace py = pybind11;
using scenario::Scenario, scenario::ScenarioRun, scenario::Solver;

constexpr unsigned kMaxThreads = 64;

struct ScenarioResult {
  organ::Organ organ;
  py::dict times, values;
  py::array tick_hashes, positions;
  py::dict thread_positions, thread_tensions;
  std::optional<std::uint64_t> state_hash;
  double seconds = 0;
  std::uint64_t unconverged_steps = 0, rejected_nodes = 0;
};

// A course is what a run has seen, before Python's lock is taken again.
struct Course {
  std::vector<std::vector<double>> times, values;  // per probe
  std::vector<std::uint64_t> hashes;
  std::uint64_t unconverged = 0, rejected = 0;
};

void run_all(ScenarioRun& run, const py::object& callback, Course& course) {
  const auto& probes = run.scenario().probes;
  course.times.resize(probes.size());
  course.values.resize(probes.size());
  Interruptible interruptible;
  while (!run.is_finished()) {
    const auto report = run.step();
    course.unconverged += report.is_converged ? 0 : 1;
    course.rejected += report.solve.nodes_rejected;
    if (run.has_ticks()) course.hashes.push_back(run.simulation().context().report.state_hash);
    for (std::size_t i = 0; i < probes.size(); ++i) {
      if (!run.is_due(i)) continue;
      const Vec3d value = run.probe(i);
      course.times[i].push_back(run.time_s());
      course.values[i].insert(course.values[i].end(), {value.x, value.y, value.z});
    }
    interruptible.check();
    if (!callback.is_none()) {
      const py::gil_scoped_acquire lock;
      callback(run.time_s());
    }
  }
}

std::vector<float> positions_of(const world::World& world) {
  std::vector<float> out;
  for (std::size_t i = 0; i < world.node_count(); ++i) {
    const Vec3f p = world.position(NodeIndex(i));
    out.insert(out.end(), {p.x, p.y, p.z});
  }
  return out;
}

// By name, of a run that has threads.
void add_threads(const ScenarioRun& run, ScenarioResult& result) {
  const auto& threads = run.simulation().state().threads;
  if (!threads) return;
  std::size_t begin = 0;
  for (const auto& rule : run.scenario().threads->threads) {
    const auto end = begin + thread::nodes_along(rule.path_m).size();
    std::vector<double> places;
    for (auto i = begin; i < end; ++i) {
      const Vec3d& p = threads->places_m[i];
      places.insert(places.end(), {p.x, p.y, p.z});
    }
    const auto first = threads->tensions_n.begin();
    std::vector<double> tensions(first + static_cast<std::ptrdiff_t>(begin),
                                 first + static_cast<std::ptrdiff_t>(end - 1));
    result.thread_positions[py::str(rule.name)] = take_array(std::move(places), 3);
    result.thread_tensions[py::str(rule.name)] = take_array(std::move(tensions), 0);
    begin = end;
  }
}

Solver solver_named(const std::string& name) {
  if (name == "live") return Solver::Live;
  if (name == "full") return Solver::Full;
  throw py::value_error("solver: is \"" + name + "\", must be live or full");
}

ScenarioResult run_scenario(const Scenario& scenario, const std::string& solver_name,
                            unsigned threads, const py::object& callback) {
  const Solver solver = solver_named(solver_name);
  if (threads < 1 || threads > kMaxThreads) throw py::value_error("threads: must be 1 to 64");
  if (!callback.is_none() && PyCallable_Check(callback.ptr()) == 0)
    throw py::type_error("callback: cannot be called");
  auto resolved = value_of(scenario::resolve(scenario));
  check(scenario::check_supported(resolved));
  ScenarioResult result;
  Course course;
  std::optional<ScenarioRun> run;
  {
    const py::gil_scoped_release others_run;
    run.emplace(std::move(resolved), solver, threads);
    run_all(*run, callback, course);
  }
  for (std::size_t i = 0; i < course.times.size(); ++i) {
    const py::str name(run->scenario().probes[i].name);
    result.times[name] = take_array(std::move(course.times[i]), 0);
    result.values[name] = take_array(std::move(course.values[i]), 3);
  }
  if (!course.hashes.empty()) result.state_hash = course.hashes.back();
  result.tick_hashes = take_array(std::move(course.hashes), 0);
  result.positions = take_array(positions_of(run->world()), 3);
  add_threads(*run, result);
  result.seconds = run->time_s();
  result.organ = run->organ();
  result.unconverged_steps = course.unconverged;
  result.rejected_nodes = course.rejected;
  return result;
}

std::vector<std::string> probe_names(const Scenario& scenario) {
  std::vector<std::string> names;
  for (const auto& probe : scenario.probes) names.push_back(probe.name);
  return names;
}

}  // namespace

void bind_scenario(py::module_& module) {
  py::class_<ScenarioResult>(module, "ScenarioResult",
                             "Probes and final state of a scenario that has run.")
      .def_readonly("times", &ScenarioResult::times,
                    "By probe: s at which it has a value; float64 (rows).")
      .def_readonly("values", &ScenarioResult::values,
                    "By probe: m, m/s or N, along x, y, z; float64 (rows x 3).")
      .def_readonly("tick_hashes", &ScenarioResult::tick_hashes,
                    "State hash after each tick, as a recording of trocar-sim --journal has it; "
                    "uint64 (ticks). Empty for static runs and the explicit integrator.")
      .def_readonly("state_hash", &ScenarioResult::state_hash,
                    "The last of tick_hashes; None without ticks.")
      .def_readonly("positions", &ScenarioResult::positions,
                    "Node positions at the end, m, world frame; float32 (nodes x 3).")
      .def_readonly("thread_positions", &ScenarioResult::thread_positions,
                    "By [[thread]]: positions of its nodes at the end, from its start, m, world "
                    "frame; float64 (nodes x 3). Nodes are 1 mm apart at rest.")
      .def_readonly("thread_tensions", &ScenarioResult::thread_tensions,
                    "By [[thread]]: tension between each node and the next at the end, N, 0 where "
                    "it is cut, negative where it is pressed; float64 (nodes - 1).")
      .def_readonly("organ", &ScenarioResult::organ,
                    "The organ with the scenario's materials, at rest.")
      .def_readonly("seconds", &ScenarioResult::seconds, "Simulated time at the end, s.")
      .def_readonly("unconverged_steps", &ScenarioResult::unconverged_steps,
                    "Steps that did not reach the tolerance in [run].")
      .def_readonly("rejected_nodes", &ScenarioResult::rejected_nodes,
                    "Nodes that had no finite step, over all steps.");
  py::class_<Scenario>(module, "Scenario",
                       "An organ, loads and scripted tools over time, as trocar-sim runs it.\n\n"
                       "Scenario(path) reads a .toml file. Raises Error with file, line and key.")
      .def(py::init([](const std::filesystem::path& path) {
             return value_of(scenario::parse_scenario(path));
           }),
           py::arg("path"))
      .def_static(
          "parse",
          [](const std::string& text, const std::string& source) {
            return value_of(scenario::parse_scenario_text(text, source));
          },
          py::arg("text"), py::arg("source") = "scenario",
          "Reads the text of such a file; `source` stands for its path, in messages and "
          "for files relative to it.")
      .def("run", &run_scenario, py::kw_only(), py::arg("solver") = "live", py::arg("threads") = 1,
           py::arg("callback") = py::none(),
           "Runs it from the start and returns a ScenarioResult; it can be run again.\n\n"
           "`solver`: live, the sweeps of a session, or full, every step to the tolerance in "
           "[run]. Results do not depend on `threads`, 1 to 64. `callback(time_s)` is called after "
           "each step; what it raises ends the run, and so does Ctrl-C.")
      .def_property_readonly("probes", &probe_names, "Names of its probes.")
      .def_property_readonly(
          "seconds", [](const Scenario& s) { return s.run.seconds; },
          "Simulated time of a whole dynamic run, s.");
}

}  // namespace trocar::python
