#pragma once

// Works that run whole ticks with tools, as the server does.

#include "tests/bench/bench_run.h"
#include "tests/bench/our_session.h"

namespace trocar::bench {

// A limit of nodes that limits nothing.
inline constexpr std::uint32_t kAllNodes = 1'000'000;
// Layers around a contact that are in the queue of a graded session.
inline constexpr std::uint32_t kNearDepth = 2;

// Surface places far from each other and from what is fixed, and outward normals there; the first
// is the surface node farthest along `first`.
std::vector<BenchTool> spread_tools(const organ::Organ& organ, std::size_t count,
                                    const Vec3f& first);

struct SessionCase {
  SessionOptions options;
  // The row's time is that of the whole tick; without, of contacts, queue and solve.
  bool includes_rest = false;
  // Forces at the tools, and the whole field at the end, against the same ticks with the whole
  // organ swept to convergence. Takes its time.
  bool is_judged = false;
};
Work run_session(organ::Organ organ, std::vector<BenchTool> tools, const SessionCase& session_case);
// Whole graded ticks, with the solve told apart into near and far: near is what the same ticks cost
// with everything outside the queue frozen, run beside it tick by tick; far is the rest.
Work run_graded_session(organ::Organ organ, std::vector<BenchTool> tools, SessionOptions options);
Row row_of(const organ::Organ& organ, std::string group, std::string object, std::string solver);

}  // namespace trocar::bench
