#include "client/app/client_summary.h"

#include <fmt/format.h>

#include <fstream>
#include <iterator>

#include "common/base/json.h"

namespace trocar::app {
namespace {

Json to_json(const replica::TimeDistribution& times) {
  return {{"count", times.count()},
          {"median", times.quantile_ms(0.5)},
          {"p99", times.quantile_ms(0.99)},
          {"largest", times.quantile_ms(1)}};
}

Json to_json(const FeltFigures& hand) {
  Json limited = Json::object();
  for (std::size_t i = 0; i < haptics::kLimits; ++i)
    limited[haptics::name_of(static_cast<haptics::Limit>(i))] = hand.state.limit_counts[i];
  return {{"device", hand.device},
          {"steps", hand.timing.steps},
          {"rate_hz", hand.timing.rate_hz},
          {"late_us",
           {{"median", hand.timing.late_median_us},
            {"p95", hand.timing.late_95_us},
            {"p99", hand.timing.late_99_us},
            {"worst", hand.timing.late_worst_us}}},
          {"overruns", hand.timing.overruns},
          {"has_real_time_priority", hand.has_priority},
          {"has_locked_memory", hand.has_locked_memory},
          {"readings_sent", hand.readings_sent},
          {"reading_interval_ms", {{"median", hand.sent_median_ms}, {"p99", hand.sent_99_ms}}},
          {"patches", hand.state.patches.patches},
          {"patches_too_old", hand.state.patches.old_patches},
          {"patches_of_no_known_pose", hand.state.patches.unmatched_patches},
          {"answer_ms", hand.state.answer_s * 1e3},
          {"slope", hand.state.slope},
          {"largest_force_n", hand.state.largest_force_n},
          {"largest_server_force_n", hand.state.largest_server_force_n},
          {"steps_limited", limited}};
}

}  // namespace

Status write_trace(const std::string& file, const std::vector<const haptics::Trace*>& hands) {
  if (file.empty()) return {};
  std::string text =
      "tool,time_us,x_m,y_m,z_m,force_x_n,force_y_n,force_z_n,server_x_n,server_y_n,server_z_n,"
      "patch_age_s,limits\n";
  for (std::size_t tool = 0; tool < hands.size(); ++tool) {
    for (const auto& row : hands[tool]->rows())
      fmt::format_to(std::back_inserter(text), "{},{},{},{},{},{},{},{},{},{},{},{},{}\n", tool,
                     row.time_us, row.tip_m.x, row.tip_m.y, row.tip_m.z, row.force_n.x,
                     row.force_n.y, row.force_n.z, row.server_force_n.x, row.server_force_n.y,
                     row.server_force_n.z, row.patch_age_s, row.limits);
  }
  std::ofstream out(file);
  out << text;
  out.close();
  if (out) return {};
  return Error{ErrorCode::ResourceMissing,
               "--hand-trace: " + file + ": cannot be written; does the folder exist?"};
}

std::string to_json(const ClientSummary& summary, const replica::Replica& replica,
                    const replica::SourceStatistics& source) {
  const auto& counters = replica.counters();
  const replica::SessionFrame* last = replica.newest();
  Json barrier;
  if (const auto& b = replica.barrier())
    barrier = {{"frame", b->frame},
               {"server_crc", hex32(b->server_crc)},
               {"own_crc", hex32(b->own_crc)},
               {"equal", b->server_crc == b->own_crc}};
  Json hands = Json::array();
  for (const auto& hand : summary.hands) hands.push_back(to_json(hand));
  return to_text({{"program", "trocar-client"},
                  {"name", summary.name},
                  {"role", summary.role},
                  {"exit_reason", summary.exit_reason},
                  {"wall_seconds", summary.wall_seconds},
                  {"organ", replica.topology().organ_name},
                  {"surface_vertices", replica.topology().rest_positions.size()},
                  {"final_frame", last != nullptr ? last->frame : 0},
                  {"final_tick", last != nullptr ? last->tick : 0},
                  {"surface_crc", hex32(replica.surface_crc())},
                  {"barrier", barrier},
                  {"recording", wire::name_of(replica.told().recording().status)},
                  {"recording_text", replica.told().recording().text},
                  {"frames", counters.frames},
                  {"keyframes", counters.keyframes},
                  {"crc_mismatches", counters.crc_mismatches},
                  {"base_mismatches", counters.base_mismatches},
                  {"surface_changes", counters.surface_changes},
                  {"marks", replica.told().mark_count()},
                  {"surface_change_bytes", counters.change_bytes},
                  {"change_mismatches", counters.change_mismatches},
                  {"healed", counters.healed},
                  {"deltas_ignored", counters.deltas_ignored},
                  {"bytes_received", counters.bytes},
                  {"bytes_sent", source.bytes_sent},
                  {"delta_payload_bytes", counters.delta_bytes},
                  {"changed_vertices", counters.changed_vertices},
                  {"bytes_per_changed_vertex", counters.bytes_per_changed_vertex()},
                  {"share_moved_over_1_mm", replica.share_moved()},
                  {"round_trip_ms", to_json(summary.round_trip)},
                  {"surface_age_ms", to_json(summary.surface_age)},
                  {"hand_to_visible_ms", to_json(summary.hand_to_visible)},
                  {"cut_to_visible_ms", to_json(summary.cut_to_visible)},
                  {"hands", hands},
                  {"frames_by_datagram", counters.by_datagram},
                  {"frames_late", counters.frames_late},
                  {"datagram_bytes_received", source.datagram_bytes_received},
                  {"datagram_bytes_sent", source.datagram_bytes_sent},
                  {"sends_dropped", source.sends_dropped},
                  {"hand_messages_refused", source.hand_messages_refused},
                  {"returns", source.returns},
                  {"longest_absence_seconds", source.longest_away_seconds},
                  {"pictures", summary.pictures}});
}

}  // namespace trocar::app
