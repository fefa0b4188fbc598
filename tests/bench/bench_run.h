#pragma once

// How a figure is measured. A Work is built, stepped a fixed number of times with each step timed
// by itself, and described by one row: the median over the steps after a warm-up of 50 (a quarter
// of a shorter run). Google Benchmark selects, repeats and prints; the rows are ours.

#include <functional>
#include <memory>
#include <string>

#include "tests/bench/result_table.h"
#include "tests/bench/thread_clock.h"

namespace trocar::bench {

enum class Scale {
  Smoke,  // tiny objects: does everything run?
  Short,  // the real objects, fewer steps: minutes
  Full,
};

// One thing that is stepped. `step` does the work and says how long it took; `finish` fills what is
// known at the end (hash, displacement, parts); it may take its time.
struct Work {
  std::function<Duration()> step;
  std::function<void(Row&)> finish;
};

struct Suite {
  Scale scale = Scale::Short;
  ResultTable results;

  bool is_smoke() const { return scale == Scale::Smoke; }
  // Steps at this scale.
  std::uint64_t steps(std::uint64_t smoke, std::uint64_t shortened, std::uint64_t full) const {
    return scale == Scale::Smoke ? smoke : scale == Scale::Short ? shortened : full;
  }
};

// Registers the work under the row's name; it is made when its turn comes. `row` holds what is
// known before.
void add_work(Suite& suite, Row row, std::uint64_t steps, std::function<Work(Row&)> make);

// The groups of benchmarks.
void add_peers(Suite& suite);
void add_targets(Suite& suite);
void add_growth(Suite& suite);
void add_queue(Suite& suite);

}  // namespace trocar::bench
