#include "tests/bench/session_work.h"

#include <algorithm>
#include <cmath>

namespace trocar::bench {
namespace {

struct Parts {
  std::vector<double> init, queue, solve, rest;
  std::vector<double> active, queued, contacts;
  std::uint32_t faults = 0;

  void add(const TickTimes& t, const TickCounts& c) {
    init.push_back(t.init);
    queue.push_back(t.queue);
    solve.push_back(t.solve);
    rest.push_back(t.rest);
    active.push_back(c.active_nodes);
    queued.push_back(c.queue_nodes);
    contacts.push_back(c.contact_nodes);
    faults |= c.faults;
  }
};

// Sweeps after which more change nothing that counts.
constexpr std::uint32_t kConvergedSweeps = 30;

void judge(Row& row, const organ::Organ& organ, std::span<const BenchTool> tools,
           SessionOptions options, const OurSession& session) {
  options.boundary = Boundary::Frozen;
  options.is_whole = true;
  options.sweeps = kConvergedSweeps;
  OurSession full(organ, tools, options);
  for (std::uint64_t i = 0; i < row.steps; ++i) full.tick();

  const auto& forces = session.published_forces();
  const auto& expected = full.published_forces();
  double peak = 0, sum = 0, largest = 0, mean = 0, full_mean = 0;
  for (const auto& force : expected) peak = std::max(peak, length(to_double(force)));
  const auto count = std::min(forces.size(), expected.size());
  for (std::size_t i = 0; i < count; ++i) {
    const double error = length(to_double(forces[i]) - to_double(expected[i]));
    sum += error;
    mean += length(to_double(forces[i])) / static_cast<double>(count);
    full_mean += length(to_double(expected[i])) / static_cast<double>(count);
    largest = std::max(largest, error);
  }
  if (count == 0 || peak == 0) return;
  row.error_percent = 100 * sum / static_cast<double>(count) / peak;
  row.more["force_error_max_percent"] = 100 * largest / peak;
  row.more["force_mean_mn"] = 1e3 * mean;
  row.more["full_force_mean_mn"] = 1e3 * full_mean;
  row.more["full_force_peak_mn"] = 1e3 * peak;

  double difference = 0, norm = 0;
  for (std::size_t n = 0; n < full.displacements().size(); ++n) {
    const Vec3d u = to_double(full.displacements()[n]);
    difference += length_squared(to_double(session.displacements()[n]) - u);
    norm += length_squared(u);
  }
  row.more["field_error_percent"] = 100 * std::sqrt(difference / norm);
}

void describe(Row& row, const Parts& parts, std::size_t contacts) {
  row.more["contacts"] = static_cast<double>(contacts);
  row.more["init_us"] = 1e6 * median(parts.init);
  row.more["queue_us"] = 1e6 * median(parts.queue);
  row.more["solve_us"] = 1e6 * median(parts.solve);
  row.more["rest_us"] = 1e6 * median(parts.rest);
  row.more["active_nodes"] = median(parts.active);
  row.more["queue_nodes"] = median(parts.queued);
  row.more["contact_nodes"] = median(parts.contacts);
  if (parts.faults != 0) row.more["fault_bits"] = parts.faults;
}

}  // namespace

std::vector<BenchTool> spread_tools(const organ::Organ& organ, std::size_t count,
                                    const Vec3f& first) {
  const auto& mesh = organ.mesh;
  const auto normals = mesh::surface_normals(mesh);
  std::vector<std::uint8_t> is_fixed(mesh.node_count());
  for (const auto node : organ.fixed_nodes) is_fixed[node.value] = 1;
  const auto place = [&](NodeIndex node) { return mesh.rest_positions[node.value]; };

  // Farthest point sampling, with the fixed nodes taken as places that are there already.
  std::vector<double> far(mesh.node_count(), 1e30);
  const auto keep_away = [&](const Vec3d& from, double weight) {
    for (const auto node : mesh.surface_nodes)
      far[node.value] = std::min(far[node.value], weight * length_squared(place(node) - from));
  };
  for (std::size_t i = 0; i < organ.fixed_nodes.size(); i += 7)
    keep_away(place(organ.fixed_nodes[i]), 4);
  std::vector<BenchTool> tools;
  while (tools.size() < count) {
    NodeIndex best;
    double best_score = -1e30;
    for (const auto node : mesh.surface_nodes) {
      if (is_fixed[node.value]) continue;
      const double score = tools.empty() ? dot(place(node), to_double(first)) : far[node.value];
      if (score > best_score) {
        best_score = score;
        best = node;
      }
    }
    keep_away(place(best), 1);
    BenchTool tool;
    tool.place = to_float(place(best));
    tool.outward = to_float(normals[best.value]);
    tools.push_back(tool);
  }
  return tools;
}

Row row_of(const organ::Organ& organ, std::string group, std::string object, std::string solver) {
  Row row;
  row.group = std::move(group);
  row.object = std::move(object);
  row.solver = std::move(solver);
  row.nodes = organ.mesh.node_count();
  row.tets = organ.mesh.tets.size();
  row.springs = organ.mesh.spring_pairs().size();
  return row;
}

Work run_session(organ::Organ organ, std::vector<BenchTool> tools,
                 const SessionCase& session_case) {
  const auto& options = session_case.options;
  auto session = std::make_shared<OurSession>(organ, tools, options);
  auto parts = std::make_shared<Parts>();
  return {[=] {
            TickTimes times;
            Duration took = timed([&] { times = session->tick(); });
            parts->add(times, session->counts());
            took.thread_cpu = times.mechanics() + (session_case.includes_rest ? times.rest : 0);
            return took;
          },
          [=, organ = std::move(organ)](Row& row) {
            describe(row, *parts, tools.size());
            row.more["state_bytes"] = static_cast<double>(session->state_bytes());
            row.more["far_sweeps"] = session->far_sweeps();
            row.state_hash = hex(session->state_hash());
            if (session_case.is_judged) judge(row, organ, tools, options, *session);
          }};
}

Work run_graded_session(organ::Organ organ, std::vector<BenchTool> tools, SessionOptions options) {
  options.boundary = Boundary::Frozen;
  auto frozen = std::make_shared<OurSession>(organ, tools, options);
  auto near = std::make_shared<std::vector<double>>();
  options.boundary = Boundary::Graded;
  Work work = run_session(std::move(organ), std::move(tools), {options, true});
  // Tick by tick, so that both meet the same load of the machine.
  work.step = [=, step = std::move(work.step)] {
    const Duration took = step();
    near->push_back(frozen->tick().solve);
    return took;
  };
  work.finish = [=, finish = std::move(work.finish)](Row& row) {
    finish(row);
    const double near_us = 1e6 * median(*near);
    const double far_us = row.more["solve_us"] - near_us;
    row.more["near_us"] = near_us;
    row.more["far_us"] = far_us;
    row.more["far_ns_per_node"] =
        1e3 * far_us / (static_cast<double>(row.nodes) - row.more["active_nodes"]);
  };
  return work;
}

}  // namespace trocar::bench
