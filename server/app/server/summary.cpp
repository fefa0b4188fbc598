#include "server/app/server/summary.h"

#include <algorithm>
#include <array>

#include "common/base/json.h"
#include "common/base/version.h"

namespace trocar::app {
namespace {

Json times(const replication::DurationHistogram& histogram) {
  return {{"count", histogram.count()},
          {"median", histogram.quantile_us(0.5)},
          {"p99", histogram.quantile_us(0.99)}};
}

Json participants(const std::vector<replication::BarrierResult>& results) {
  Json list = Json::array();
  for (const auto& result : results)
    list.push_back({{"slot", result.slot.value},
                    {"name", result.name},
                    {"role", participants::name_of(result.role)},
                    {"answered", result.has_answered},
                    {"frame", result.frame},
                    {"surface_crc", hex32(result.surface_crc)},
                    {"equal", result.is_equal}});
  return list;
}

Json stages(const StageTimes& of) {
  Json list = Json::object();
  for (std::size_t i = 0; i < of.stages.size(); ++i)
    list[wire::name_of(static_cast<step::Stage>(i))] = times(of.stages[i]);
  return list;
}

Json datagram_figures(const Summary& s) {
  const auto& d = s.datagrams;
  return {{"paths", d.paths},
          {"sent", d.sent},
          {"received", d.received},
          {"dropped", d.dropped},
          {"rests", s.replication.datagram_rests},
          {"bytes_sent", d.bytes_out},
          {"bytes_received", d.bytes_in},
          {"encode_slices_cpu_us", times(s.encoding.slices_cpu)}};
}

Json replication_figures(const Summary& s) {
  const auto& e = s.encoding;
  const double per_vertex = e.changed_vertices ? static_cast<double>(e.delta_payload_bytes) /
                                                     static_cast<double>(e.changed_vertices)
                                               : 0.0;
  const auto& r = s.replication;
  return {{"sessions", r.sessions},
          {"connections_lost", r.lost},
          {"returned", r.returned},
          {"bytes_sent", s.tcp.bytes_out},
          {"bytes_received", s.tcp.bytes_in},
          {"samples", r.samples},
          {"hand_reports", r.hand_reports},
          {"samples_dropped", s.inbox.samples_dropped},
          {"frames_published", r.frames_published},
          {"frames_conflated", r.frames_conflated},
          {"frames_lost", s.frames_lost},
          {"frames_given", r.frames_given},
          {"frames_skipped", r.frames_skipped},
          {"frames_by_datagram", r.frames_by_datagram},
          {"keyframes_given", r.keyframes_given},
          {"datagrams", datagram_figures(s)},
          {"buffers_shared", e.shared},
          {"deltas", e.deltas},
          {"delta_payload_bytes", e.delta_payload_bytes},
          {"changed_vertices", e.changed_vertices},
          {"bytes_per_changed_vertex", per_vertex},
          {"encode_delta_cpu_us", times(e.delta_cpu)},
          {"encode_keyframe_cpu_us", times(e.keyframe_cpu)}};
}

// Says who was kept out or sent away, and why.
Json limit_figures(const Summary& s) {
  Json ended = Json::object();
  for (std::size_t i = 0; i < s.replication.ended.size(); ++i)
    if (s.replication.ended[i] > 0)
      ended[name_of(static_cast<replication::EndReason>(i))] = s.replication.ended[i];
  return {{"connections", s.tcp.accepted},
          {"connections_rejected", s.tcp.rejected_full},
          {"newcomers_dropped", s.tcp.newcomers_dropped},
          {"handshakes_failed", s.tcp.handshakes_failed},
          {"connection_faults", s.tcp.faults},
          {"joined", s.access.joined},
          {"refused", s.access.refused},
          {"wrong_codes", s.access.wrong_tries},
          {"floods", s.replication.floods},
          {"ended", ended}};
}

Json rate_figures(const Summary& s) {
  const auto& rate = s.loop.rate;
  const auto& last = s.loop.last_frame->figures.pace.rate;
  std::array<double, step::kSweepLayers> mean_sweeps{};
  for (std::size_t i = 0; i < mean_sweeps.size(); ++i)
    mean_sweeps[i] = static_cast<double>(rate.sweeps[i]) /
                     static_cast<double>(std::max<Tick>(1, rate.contact_ticks));
  Json ticks = Json::object();
  for (std::size_t i = 0; i < rate.ticks_at.size(); ++i)
    ticks[wire::name_of(static_cast<wire::RateLevel>(i))] = rate.ticks_at[i];
  Json waits = Json::object();
  for (std::size_t i = 0; i < kMaxTools; ++i)
    if (rate.waits[i] > 0) waits["tool-" + std::to_string(i)] = rate.waits[i];
  return {
      {"ticks", ticks},
      {"late_ticks", rate.late_ticks},
      {"held_back_ticks", waits},
      {"lowered", last.lowered},
      {"raised", last.raised},
      {"budget_us", last.budget_us},
      {"contact_ticks", rate.contact_ticks},
      {"mean_workers_in_contact", static_cast<double>(rate.contact_workers) /
                                      static_cast<double>(std::max<Tick>(1, rate.contact_ticks))},
      {"mean_sweeps_in_contact", mean_sweeps},
      {"least_sweeps", rate.least_sweeps},
      {"least_node_limit", rate.least_node_limit}};
}

// Says what has bled; null in a session that does not.
Json blood_figures(const Summary& s) {
  const auto& last = *s.loop.last_frame;
  if (!last.figures.blood) return nullptr;
  const auto ml = [](std::uint64_t nl) { return static_cast<double>(nl) * 1e-6; };
  const auto& blood = *last.figures.blood;
  return {{"shed_ml", ml(blood.shed_nl)},       {"on_surface_ml", ml(blood.on_surface_nl)},
          {"dripped_ml", ml(blood.dripped_nl)}, {"sucked_ml", ml(blood.sucked_nl)},
          {"sources", blood.sources},           {"open_vessels", blood.open_vessels},
          {"levels_crc", hex32(last.blood_crc)}};
}

}  // namespace

std::string to_json(const Summary& s) {
  const auto& last = *s.loop.last_frame;
  return to_text(
      {{"program", "trocar-server"},
       {"version", kVersion},
       {"sim_version", kSimVersion},
       {"protocol", std::to_string(kProtocolMajor) + "." + std::to_string(kProtocolMinor)},
       {"organ", s.organ},
       {"nodes", s.node_count},
       {"surface_vertices", s.surface_vertex_count},
       {"journal", s.journal},
       {"recording",
        {{"status", wire::name_of(s.recording.status)},
         {"frames_missing", s.recording.frames_missing},
         {"text", s.recording.text}}},
       {"ticks", s.loop.ticks},
       {"simulated_seconds",
        static_cast<double>(s.loop.ticks) / static_cast<double>(kTicksPerSecond)},
       {"wall_seconds", s.wall_seconds},
       {"slow_ticks", s.loop.slow_ticks},
       {"last_tick", last.tick},
       {"last_frame", last.frame},
       {"state_hash", hex64(last.figures.state_hash)},
       {"surface_crc", hex32(last.surface_crc)},
       {"all_replicas_equal",
        std::ranges::all_of(s.barrier, &replication::BarrierResult::is_equal)},
       {"participants", participants(s.barrier)},
       {"max_active_nodes", s.loop.max_active_nodes},
       {"faults", s.loop.faults},
       {"inputs_dropped", s.loop.inputs_dropped},
       {"nodes_rejected", s.loop.nodes_rejected},
       {"rate", rate_figures(s)},
       {"blood", blood_figures(s)},
       {"tick_cpu_us", times(s.loop.times.tick)},
       {"stage_cpu_us", stages(s.loop.times)},
       {"limits", limit_figures(s)},
       {"replication", replication_figures(s)}});
}

}  // namespace trocar::app
