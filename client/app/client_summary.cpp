#include "client/app/client_summary.h"

#include <cstdio>

#include "common/base/quote.h"

namespace trocar::app {
namespace {

class JsonObject {
 public:
  explicit JsonObject(std::string indent) : indent_(std::move(indent)) {}
  void add(const char* key, const std::string& raw) {
    text_ += text_.empty() ? "{\n" : ",\n";
    text_ += indent_ + "  \"" + key + "\": " + raw;
  }
  void add_text(const char* key, const std::string& text) { add(key, quote(text)); }
  void add_count(const char* key, std::uint64_t value) { add(key, std::to_string(value)); }
  void add_number(const char* key, double value) {
    char text[40];
    std::snprintf(text, sizeof text, "%.6g", value);
    add(key, text);
  }
  void add_crc(const char* key, std::uint32_t value) {
    char text[16];
    std::snprintf(text, sizeof text, "\"%08x\"", value);
    add(key, text);
  }
  std::string finish() const { return text_ + "\n" + indent_ + "}"; }

 private:
  std::string indent_, text_;
};

}  // namespace

std::string to_json(const ClientSummary& summary, const replica::Replica& replica,
                    const replica::SourceStatistics& source) {
  const auto& counters = replica.counters();
  const replica::SessionFrame* last = replica.newest();
  JsonObject json("");
  json.add_text("program", "trocar-client");
  json.add_text("name", summary.name);
  json.add_text("role", summary.role);
  json.add_text("exit_reason", summary.exit_reason);
  json.add_number("wall_seconds", summary.wall_seconds);
  json.add_text("organ", replica.topology().organ_name);
  json.add_count("surface_vertices", replica.topology().rest_positions.size());
  json.add_count("final_frame", last != nullptr ? last->frame : 0);
  json.add_count("final_tick", last != nullptr ? last->tick : 0);
  json.add_crc("surface_crc", replica.surface_crc());
  if (replica.barrier()) {
    JsonObject barrier("  ");
    barrier.add_count("frame", replica.barrier()->frame);
    barrier.add_crc("server_crc", replica.barrier()->server_crc);
    barrier.add_crc("own_crc", replica.barrier()->own_crc);
    barrier.add("equal",
                replica.barrier()->server_crc == replica.barrier()->own_crc ? "true" : "false");
    json.add("barrier", barrier.finish());
  } else {
    json.add("barrier", "null");
  }
  json.add_text("recording", wire::name_of(replica.recording().status));
  json.add_text("recording_text", replica.recording().text);
  json.add_count("frames", counters.frames);
  json.add_count("keyframes", counters.keyframes);
  json.add_count("crc_mismatches", counters.crc_mismatches);
  json.add_count("base_mismatches", counters.base_mismatches);
  json.add_count("surface_changes", counters.surface_changes);
  json.add_count("marks", counters.marks);
  json.add_count("surface_change_bytes", counters.change_bytes);
  json.add_count("change_mismatches", counters.change_mismatches);
  json.add_count("healed", counters.healed);
  json.add_count("deltas_ignored", counters.deltas_ignored);
  json.add_count("ghosts", counters.ghosts);
  json.add_count("ghosts_ignored", counters.ghosts_ignored);
  json.add_count("bytes_received", counters.bytes);
  json.add_count("bytes_sent", source.bytes_sent);
  json.add_count("delta_payload_bytes", counters.delta_bytes);
  json.add_count("changed_vertices", counters.changed_vertices);
  json.add_number("bytes_per_changed_vertex", counters.bytes_per_changed_vertex());
  json.add_number("share_moved_over_1_mm", replica.share_moved());
  json.add_number("round_trip_ms", summary.round_trip_ms);
  json.add_count("sends_dropped", source.sends_dropped);
  json.add_count("pictures", summary.pictures);
  return json.finish() + "\n";
}

}  // namespace trocar::app
