#include "tests/bench/session_work.h"

#include <algorithm>

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

}  // namespace

std::vector<BenchTool> spread_tools(const scene::Organ& organ, std::size_t count,
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

Row row_of(const scene::Organ& organ, std::string group, std::string object, std::string solver) {
  Row row;
  row.group = std::move(group);
  row.object = std::move(object);
  row.solver = std::move(solver);
  row.nodes = organ.mesh.node_count();
  row.tets = organ.mesh.tets.size();
  row.springs = organ.mesh.spring_pairs().size();
  return row;
}

Work run_session(scene::Organ organ, std::vector<BenchTool> tools, const SessionOptions& options,
                 bool includes_rest) {
  auto session = std::make_shared<OurSession>(std::move(organ), tools, options);
  auto parts = std::make_shared<Parts>();
  const double contacts = static_cast<double>(tools.size());
  return {[=] {
            TickTimes times;
            Duration took = timed([&] { times = session->tick(); });
            parts->add(times, session->counts());
            took.thread_cpu = times.mechanics() + (includes_rest ? times.rest : 0);
            return took;
          },
          [=](Row& row) {
            row.more["contacts"] = contacts;
            row.more["init_us"] = 1e6 * median(parts->init);
            row.more["queue_us"] = 1e6 * median(parts->queue);
            row.more["solve_us"] = 1e6 * median(parts->solve);
            row.more["rest_us"] = 1e6 * median(parts->rest);
            row.more["active_nodes"] = median(parts->active);
            row.more["queue_nodes"] = median(parts->queued);
            row.more["contact_nodes"] = median(parts->contacts);
            row.state_hash = hex(session->state_hash());
            if (parts->faults != 0) row.more["fault_bits"] = parts->faults;
          }};
}

}  // namespace trocar::bench
