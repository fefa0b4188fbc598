#include "server/app/server/summary.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>

#include "common/base/quote.h"
#include "common/base/version.h"

namespace trocar::app {
namespace {

std::string times(const replication::DurationHistogram& histogram) {
  return fmt::format(R"({{"count": {}, "median": {:.3f}, "p99": {:.3f}}})", histogram.count(),
                     histogram.quantile_us(0.5), histogram.quantile_us(0.99));
}

std::string participants(const std::vector<replication::BarrierResult>& results) {
  std::string out;
  for (const auto& result : results)
    out += fmt::format(
        "{}\n    {{\"slot\": {}, \"name\": {}, \"role\": \"{}\", \"answered\": {}, \"frame\": {}, "
        "\"surface_crc\": \"{:08x}\", \"equal\": {}}}",
        out.empty() ? "" : ",", result.slot.value, quote(result.name),
        participants::name_of(result.role), result.has_answered, result.frame, result.surface_crc,
        result.is_equal);
  return out;
}

std::string stages(const StageTimes& of) {
  std::string out;
  for (std::size_t i = 0; i < of.stages.size(); ++i)
    out += fmt::format("{}\n    \"{}\": {}", out.empty() ? "" : ",",
                       step::name_of(static_cast<step::Stage>(i)), times(of.stages[i]));
  return out;
}

std::string replication_figures(const Summary& s) {
  const auto& e = s.encoding;
  const double per_vertex = e.changed_vertices ? static_cast<double>(e.delta_payload_bytes) /
                                                     static_cast<double>(e.changed_vertices)
                                               : 0.0;
  const auto& r = s.replication;
  return fmt::format(
      R"("sessions": {}, "bytes_sent": {}, "bytes_received": {}, "samples": {},
    "samples_dropped": {}, "frames_published": {}, "frames_conflated": {}, "frames_lost": {},
    "frames_given": {}, "frames_skipped": {}, "keyframes_given": {}, "buffers_shared": {},
    "deltas": {}, "delta_payload_bytes": {}, "changed_vertices": {},
    "bytes_per_changed_vertex": {:.3f},
    "encode_delta_cpu_us": {}, "encode_keyframe_cpu_us": {})",
      r.sessions, s.tcp.bytes_out, s.tcp.bytes_in, r.samples, s.inbox.samples_dropped,
      r.frames_published, r.frames_conflated, s.frames_lost, r.frames_given, r.frames_skipped,
      r.keyframes_given, e.shared, e.deltas, e.delta_payload_bytes, e.changed_vertices, per_vertex,
      times(e.delta_cpu), times(e.keyframe_cpu));
}

std::string rate_figures(const Summary& s) {
  const auto& rate = s.loop.rate;
  const auto& last = s.loop.last_frame->statistics.rate;
  const auto list = [](const auto& values) { return fmt::format("[{}]", fmt::join(values, ", ")); };
  std::array<double, step::kSweepLayers> mean_sweeps{};
  for (std::size_t i = 0; i < mean_sweeps.size(); ++i)
    mean_sweeps[i] = static_cast<double>(rate.sweeps[i]) /
                     static_cast<double>(std::max<Tick>(1, rate.contact_ticks));
  std::string ticks;
  for (std::size_t i = 0; i < rate.ticks_at.size(); ++i)
    ticks += fmt::format("{}\"{}\": {}", i == 0 ? "" : ", ",
                         step::name_of(static_cast<step::RateLevel>(i)), rate.ticks_at[i]);
  return fmt::format(
      R"({{
    "ticks": {{{}}}, "late_ticks": {}, "lowered": {}, "raised": {}, "budget_us": {:.1f},
    "contact_ticks": {}, "mean_sweeps_in_contact": {}, "least_sweeps": {}, "least_node_limit": {}
  }})",
      ticks, rate.late_ticks, last.lowered, last.raised, last.budget_us, rate.contact_ticks,
      list(mean_sweeps), list(rate.least_sweeps), rate.least_node_limit);
}

// How long each solver acted, and why others took over.
std::string solver_figures(const Summary& s) {
  if (!s.reduction) return "null";
  const auto& solver = s.loop.solver;
  const auto by_reason = [](const auto& counts) {
    std::string out;
    for (std::size_t i = 1; i < counts.size(); ++i)  // from 0, a session without a reduction
      out += fmt::format("{}\"{}\": {}", out.empty() ? "" : ", ",
                         step::name_of(static_cast<step::SolverReason>(i)), counts[i]);
    return out;
  };
  return fmt::format(
      R"({{
    "reduction": {}, "reduction_hash": "{:016x}", "reduced_ticks": {}, "full_ticks": {},
    "to_reduced": {}, "to_full": {}, "to_another_patch": {}, "largest_estimate": {:.4g},
    "ticks_by_reason": {{{}}},
    "to_full_by_reason": {{{}}},
    "ghost": {{"frames": {}, "begun": {}, "fallen_behind": {}, "largest_mm": {:.4g}}}
  }})",
      quote(s.reduction->file), s.reduction->hash, solver.reduced_ticks, solver.full_ticks,
      solver.to_reduced, solver.to_full, solver.to_another_patch, solver.largest_estimate,
      by_reason(solver.ticks_by_reason), by_reason(solver.to_full_by_reason), s.ghost.frames,
      s.ghost.begun, s.ghost.fallen, 1e3 * static_cast<double>(s.ghost.largest_m));
}

}  // namespace

std::string to_json(const Summary& s) {
  const auto& last = *s.loop.last_frame;
  bool all_equal = true;
  for (const auto& result : s.barrier) all_equal = all_equal && result.is_equal;
  return fmt::format(
      R"({{
  "program": "trocar-server", "version": "{}", "sim_version": {}, "protocol": "{}.{}",
  "organ": {}, "nodes": {}, "surface_vertices": {}, "journal": {},
  "ticks": {}, "simulated_seconds": {:.3f}, "wall_seconds": {:.3f}, "slow_ticks": {},
  "last_tick": {}, "last_frame": {}, "state_hash": "{:016x}", "surface_crc": "{:08x}",
  "all_replicas_equal": {},
  "participants": [{}
  ],
  "max_active_nodes": {}, "faults": {}, "inputs_dropped": {}, "nodes_rejected": {},
  "rate": {},
  "solver": {},
  "tick_cpu_us": {},
  "stage_cpu_us": {{{}
  }},
  "replication": {{
    {}
  }}
}}
)",
      kVersion, kSimVersion, kProtocolMajor, kProtocolMinor, quote(s.organ), s.node_count,
      s.surface_vertex_count, quote(s.journal), s.loop.ticks,
      static_cast<double>(s.loop.ticks) / static_cast<double>(kTicksPerSecond), s.wall_seconds,
      s.loop.slow_ticks, last.tick, last.frame, last.state_hash, last.surface_crc, all_equal,
      participants(s.barrier), s.loop.max_active_nodes, s.loop.faults, s.loop.inputs_dropped,
      s.loop.nodes_rejected, rate_figures(s), solver_figures(s), times(s.loop.times.tick),
      stages(s.loop.times), replication_figures(s));
}

}  // namespace trocar::app
