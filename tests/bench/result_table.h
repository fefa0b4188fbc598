#pragma once

// The figures of a run of the benchmarks: rows gathered while they run, then written as JSON, CSV,
// Markdown and columns for gnuplot. A figure that was not measured is absent, never zero.

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace trocar::bench {

// Times are CPU time of one thread per step, unless the name says otherwise.
struct Row {
  std::string group;   // peers, targets, queue, nodes, graded, contacts
  std::string object;  // what is simulated: mesh or experiment
  std::string solver;  // by what
  std::size_t nodes = 0, tets = 0, springs = 0;
  std::uint32_t threads = 1;
  std::uint64_t steps = 0;  // done; the first 50, or a quarter of fewer, are not in the times
  double dt_ms = 1;
  double median_us = 0, p10_us = 0, p90_us = 0;
  // With several threads: medians of wall time and of all threads' CPU time (theirs and waits), and
  // the wall time that a tenth of the steps did not exceed. On a busy machine threads wait for
  // cores.
  std::optional<double> wall_us, wall_p10_us, all_threads_us;
  // Displacement of the loaded face at 0.1 s, and the same mesh, law and step solved to
  // convergence.
  std::optional<double> u_mm, converged_mm, error_percent;
  // Figures from elsewhere, ms per step: of the paper, of the best other library as measured
  // before, and what is aimed at.
  std::string paper_ms, peer_ms;
  std::string peer_row;  // name of the peer's row that does like work, if it is in this run
  std::optional<double> target_ms;
  // A target is not reached with a larger error than this, however fast.
  std::optional<double> error_limit_percent;
  std::map<std::string, double> more;  // nodes in the queue, parts of a tick, ...
  std::string state_hash;              // 16 hex digits, after the last step
  std::string note;

  std::string name() const { return group + "/" + object + "/" + solver; }
};

struct Machine {
  std::string processor, compiler, isa, build_type, peer_version;
  std::string commit = "unknown";
  unsigned cores = 0;
  double load_before = 0, load_after = 0;  // 1 min averages

  bool is_busy() const;
};
Machine this_machine();
double load_average();

class ResultTable {
 public:
  void add(Row row) { rows_.push_back(std::move(row)); }
  const std::vector<Row>& rows() const { return rows_; }

  std::string markdown(const Machine& machine) const;
  // Writes bench.json, bench.csv, bench.md and plots/*.dat into an existing folder.
  Status write(const std::filesystem::path& folder, const Machine& machine) const;

 private:
  std::vector<Row> rows_;
};

std::string hex(std::uint64_t hash);

}  // namespace trocar::bench
