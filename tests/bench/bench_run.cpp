#include "tests/bench/bench_run.h"

#include <benchmark/benchmark.h>

#include <algorithm>

namespace trocar::bench {
namespace {

constexpr std::uint64_t kWarmUpSteps = 50;

struct Job {
  Suite& suite;
  Row known;
  std::function<Work(Row&)> make;

  void run(benchmark::State& state) const;
};

void Job::run(benchmark::State& state) const {
  Row row = known;
  Work work = make(row);
  std::vector<double> thread, process, wall;
  for (auto _ : state) {
    const Duration took = work.step();
    thread.push_back(took.thread_cpu);
    process.push_back(took.process_cpu);
    wall.push_back(took.wall);
    state.SetIterationTime(took.thread_cpu);
  }
  const auto warm_up = std::min<std::size_t>(kWarmUpSteps, thread.size() / 4);
  const auto measured = [&](const std::vector<double>& times) {
    return std::span(times).subspan(warm_up);
  };
  row.steps = thread.size();
  row.median_us = 1e6 * median(measured(thread));
  row.p10_us = 1e6 * percentile(measured(thread), 0.1);
  row.p90_us = 1e6 * percentile(measured(thread), 0.9);
  if (row.threads > 1) {
    row.all_threads_us = 1e6 * median(measured(process));
    row.wall_us = 1e6 * median(measured(wall));
    row.wall_p10_us = 1e6 * percentile(measured(wall), 0.1);
  }
  work.finish(row);
  state.counters["median_us"] = row.median_us;
  state.counters["nodes"] = static_cast<double>(row.nodes);
  if (row.u_mm) state.counters["u_mm"] = *row.u_mm;
  state.SetLabel("hash " + row.state_hash);
  suite.results.add(std::move(row));
}

}  // namespace

void add_work(Suite& suite, Row row, std::uint64_t steps, std::function<Work(Row&)> make) {
  const std::string name = row.name();
  const auto job = std::make_shared<Job>(Job{suite, std::move(row), std::move(make)});
  benchmark::RegisterBenchmark(name.c_str(), [job](benchmark::State& state) { job->run(state); })
      ->Iterations(static_cast<benchmark::IterationCount>(steps))
      ->UseManualTime()
      ->Unit(benchmark::kMillisecond);
}

}  // namespace trocar::bench
