#include "server/app/server/server_figures.h"

#include <array>
#include <bit>

#include "server/session/monitoring/exposition.h"
#include "server/tissue/step/tick_report.h"

namespace trocar::app {
namespace {

using monitoring::Exposition;
using monitoring::Labelled;

double number(std::uint64_t count) {
  return static_cast<double>(count);
}

double seconds(float microseconds) {
  return static_cast<double>(microseconds) * 1e-6;
}

void add_simulation(const ServerFigures& f, Exposition& text) {
  text.gauge("paused", "1 while an instructor has paused the session.", f.is_paused);
  text.gauge("frame_age_seconds", "Time since the newest frame came from the simulation.",
             f.frame_age_s);
  text.counter("frames_lost_total", "Frames that were lost on the way to the network thread.",
               number(f.frames_lost));
  if (f.newest == nullptr) return;
  const auto& pace = f.newest->figures.pace;
  text.counter("ticks_total", "Ticks that were simulated, of 1 ms each.", number(f.newest->tick));
  text.counter("slow_ticks_total", "Ticks by which simulated time fell behind real time.",
               number(pace.slow_ticks));
  text.gauge("time_rate", "Simulated time over real time, in the last second.",
             static_cast<double>(pace.rate.time_rate));
  text.gauge("held_back_tools",
             "Tools that were held back in the last second, so that time does not slow.",
             number(static_cast<std::uint64_t>(std::popcount(pace.rate.waiting_tools))));
  text.gauge("rate_level", "0: fixed, 1: all that was asked for, 2: less, 3: overloaded.",
             static_cast<double>(pace.rate.level));
  text.gauge("tick_median_seconds", "Processor time of a tick, median of the last second.",
             seconds(pace.tick_median_us));
  text.gauge("tick_p99_seconds", "Processor time of a tick, 99th percentile of the last second.",
             seconds(pace.tick_p99_us));
  std::vector<Labelled> stages;
  for (std::size_t i = 0; i < pace.stage_median_us.size(); ++i)
    stages.emplace_back(wire::name_of(static_cast<step::Stage>(i)),
                        seconds(pace.stage_median_us[i]));
  text.gauges("stage_median_seconds", "Processor time of a stage, median of the last second.",
              "stage", stages);
  double claims = 0;
  for (const auto& tool : f.newest->tools) claims += tool.has_claim;
  text.gauge("claims", "Tools whose push, grasp or cut is in effect.", claims);
  text.gauge("active_nodes", "Nodes that the forces of all tools reach.",
             number(f.newest->figures.near.active_nodes));
}

void add_people(const ServerFigures& f, Exposition& text) {
  std::array<double, 4> by_role{};
  const std::array roles{wire::Role::Surgeon, wire::Role::Assistant, wire::Role::Instructor,
                         wire::Role::Observer};
  double away = 0, relayed = 0;
  for (const auto& who : f.people) {
    away += who.is_away;
    relayed += who.is_away ? 0 : who.relayed;
    for (std::size_t i = 0; i < roles.size(); ++i) by_role[i] += who.role == roles[i];
  }
  std::vector<Labelled> series;
  for (std::size_t i = 0; i < roles.size(); ++i)
    series.emplace_back(wire::name_of(roles[i]), by_role[i]);
  text.gauges("people", "People in the session.", "role", series);
  text.gauge("people_away", "Of these, who have lost the connection and may return.", away);
  text.gauge("people_relayed", "Further people who watch through relays.", relayed);
  text.counter("joins_total", "Joins that were let in.", number(f.replication.sessions));
  text.counter("joins_refused_total", "Joins that were refused at the door.",
               number(f.access.refused));
  text.counter("wrong_codes_total", "Wrong join codes.", number(f.access.wrong_tries));
  text.counter("connections_lost_total", "Connections that broke, of who could return.",
               number(f.replication.lost));
  text.counter("returns_total", "Of these, who came back.", number(f.replication.returned));
}

void add_network(const ServerFigures& f, Exposition& text) {
  text.gauge("connections", "Connections now.", number(f.connections));
  text.counter("connections_total", "Connections that were accepted.", number(f.tcp.accepted));
  text.counter("connections_rejected_total", "Connections that were too many.",
               number(f.tcp.rejected_full));
  text.counter("handshakes_failed_total", "Connections closed before TLS was there.",
               number(f.tcp.handshakes_failed));
  text.counters("received_bytes_total", "Bytes from clients.", "path",
                {{"stream", number(f.tcp.bytes_in)}, {"datagram", number(f.datagrams.bytes_in)}});
  text.counters("sent_bytes_total", "Bytes to clients.", "path",
                {{"stream", number(f.tcp.bytes_out)}, {"datagram", number(f.datagrams.bytes_out)}});
  text.counter("datagrams_dropped_total", "Datagrams that the socket did not take.",
               number(f.datagrams.dropped));
  text.counter("datagram_rests_total", "Times that the stream took over from lost datagrams.",
               number(f.replication.datagram_rests));
  text.counter("client_frames_total", "Frames given to clients.",
               number(f.replication.frames_given));
  text.counter("client_frames_skipped_total", "Frames left out for clients that were behind.",
               number(f.replication.frames_skipped));
  text.counter("samples_total", "Samples of tools that were taken.", number(f.inbox.samples_taken));
  text.counter("samples_dropped_total", "Samples of tools that found no room.",
               number(f.inbox.samples_dropped));
}

void add_recording(const ServerFigures& f, Exposition& text) {
  std::vector<Labelled> states;
  for (const auto status : {wire::RecordingStatus::Off, wire::RecordingStatus::Whole,
                            wire::RecordingStatus::Gapped, wire::RecordingStatus::Failed})
    states.emplace_back(wire::name_of(status), f.recording.status == status ? 1.0 : 0.0);
  text.gauges("recording_status", "1 at what the recording is.", "status", states);
  text.counter("recording_frames_missing_total", "Frames that the recording lacks.",
               number(f.recording.frames_missing));
  text.gauge("recording_queued_bytes", "Bytes that wait to be written.",
             number(f.recording_queued_bytes));
  text.counter("recording_syncs_total",
               "Times that the recording was brought to the disk. A loss of power takes what came "
               "after the last, about a second.",
               number(f.recording_syncs));
  const auto& sample = f.disk.newest();
  if (!sample) return;
  text.gauge("recording_bytes", "Size of the recording.", number(sample->recorded_bytes));
  text.gauge("recording_disk_available_bytes", "Room on its file system.",
             number(sample->available_bytes));
  if (const auto left = f.disk.seconds_left())
    text.gauge("recording_disk_left_seconds", "Time until it is full, at the present rate.", *left);
}

}  // namespace

std::string to_exposition(const ServerFigures& figures) {
  Exposition text("trocar_");
  add_simulation(figures, text);
  add_people(figures, text);
  add_network(figures, text);
  add_recording(figures, text);
  return text.text();
}

}  // namespace trocar::app
