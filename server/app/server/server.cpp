#include "server/app/server/server.h"

#include "common/base/asio.h"  // before Boost: see there

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "common/base/log.h"
#include "common/base/signals.h"
#include "common/base/text_file.h"
#include "common/base/timing.h"
#include "common/base/version.h"
#include "common/discovery/announcer.h"
#include "common/secure/loopback.h"
#include "server/app/server/admission.h"
#include "server/app/server/browser_page.h"
#include "server/app/server/check_start.h"
#include "server/app/server/server_figures.h"
#include "server/app/server/session_start.h"
#include "server/app/server/simulation_loop.h"
#include "server/app/server/summary.h"
#include "server/session/agones/agones.h"
#include "server/session/monitoring/disk_watch.h"
#include "server/session/monitoring/figures_server.h"
#include "server/session/net/tcp_server.h"
#include "server/session/replication/messages.h"
#include "server/session/replication/replicator.h"
#include "server/tissue/touch/haptic_law.h"
#include "server/watch/crowd/guest_connections.h"

namespace trocar::app {
namespace {

using std::chrono::milliseconds;
constexpr milliseconds kBarrierDeadline{2000};
constexpr milliseconds kGoodbyeDeadline{2500};  // a little more than the flush deadline
constexpr milliseconds kPollPeriod{5};
constexpr milliseconds kAttentionPeriod{50};
constexpr std::chrono::seconds kDiskPeriod{5};
// A simulation that shows nothing for longer than this stands still.
constexpr double kStillAfter_s = 10;
// Slower than this is said in the log, once in a while.
constexpr float kSlowTimeRate = 0.98f;
constexpr float kLongTickMs = 0.9f;
constexpr Tick kWarningPeriod = 10 * kTicksPerSecond;

Tick ticks_of(double seconds) {
  return static_cast<Tick>(std::llround(seconds * static_cast<double>(kTicksPerSecond)));
}

std::string machine_name() {
  std::array<char, 256> name{};
  return ::gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "this machine";
}

// Calls `then` when `is_done` holds, at the latest after `deadline`.
void wait_for(asio::steady_timer& poll, std::function<bool()> is_done, milliseconds deadline,
              std::function<void()> then) {
  if (is_done() || deadline <= milliseconds::zero()) return then();
  poll.expires_after(kPollPeriod);
  poll.async_wait([&poll, is_done, deadline, then](boost::system::error_code error) {
    if (!error) wait_for(poll, is_done, deadline - kPollPeriod, then);
  });
}

class Server {
 public:
  Server(const ServerOptions& options, std::unique_ptr<Admission> admission, SessionStart start)
      : options_(options),
        admission_(std::move(admission)),
        start_(std::move(start)),
        simulation_(start_.simulation) {}

  // Binds the port and opens the journal.
  Status open();
  // Until the session has ended.
  Status run();

 private:
  step::TickDecisions most_decisions() const;
  LoopOptions loop_options();
  // Lets those who were in a session that goes on come back; other hands leave.
  void restore_people();
  void note_participants(const std::vector<participants::Participant>& present, Tick tick);
  void settle_rate();
  void announce();
  void publish_frames();
  void warn_if_slow();
  void tell_who_waits();
  Status open_figures();
  Status open_sidecar();
  wire::RecordingState recording_state() const;
  // Looks at the disk of the recording now and then, warns, and ends the recording before it is
  // full.
  void watch_disk();
  double frame_age_s() const;
  std::string ill() const;
  std::string not_ready() const;
  std::string metrics() const;
  void on_signal(int signal);
  void attend();
  void begin_end();
  void say_goodbye();
  Status finish();
  Status write_end();

  const ServerOptions& options_;
  const std::unique_ptr<Admission> admission_;
  SessionStart start_;
  step::Simulation& simulation_;
  std::unique_ptr<JournalSink> journal_;
  participants::SimulationInbox inbox_;
  asio::io_context io_{1};
  asio::signal_set signals_{io_};
  asio::steady_timer poll_{io_}, attention_{io_}, disk_timer_{io_};
  std::unique_ptr<net::TcpServer> tcp_;
  std::unique_ptr<crowd::GuestConnections> connections_;  // all of them, guests as well
  std::unique_ptr<discovery::Announcer> announcer_;       // null: the session is not announced
  std::unique_ptr<replication::Replicator> replicator_;
  std::unique_ptr<monitoring::FiguresServer> figures_;  // null: not asked for
  std::uint16_t sidecar_port_ = agones::kDefaultPort;
  std::unique_ptr<agones::Sidecar> sidecar_;  // null: not asked for
  std::unique_ptr<BrowserPage> page_;         // null: not asked for
  monitoring::DiskWatch disk_;
  FrameHandover handover_{[this] { asio::post(io_, [this] { publish_frames(); }); }};
  std::vector<step::SharedFrame> frames_;
  step::SharedFrame newest_;
  std::uint64_t newest_ns_ = 0;  // when it came
  std::vector<replication::BarrierResult> barrier_;
  std::optional<Status> closed_;  // the recording, once it is
  std::string goodbye_ = "the session is over";
  float rate_ = 1;            // as an instructor wants it
  bool is_awaiting_ = false;  // time begins when enough people are there
  bool is_ending_ = false, is_paused_ = false;
  Tick next_warning_ = 0;
  // Bits of tools of which the log has said that they are held back, and when it may say so again.
  std::uint32_t told_waiting_ = 0;
  Tick next_told_ = 0;
  double wall_seconds_ = 0;
  std::unique_ptr<SimulationLoop> loop_;  // its thread uses what stands above
};

Status Server::open() {
  if (const auto opened = open_sidecar(); !opened) return opened;
  const auto& organ = simulation_.organ();
  const auto& layout = simulation_.layout();
  net::TcpServerOptions tcp{.address = options_.address, .port = options_.port};
  // Topology and a keyframe of about that size must fit at once for somebody who joins, and for
  // everybody after a return to a mark; cuts make the surface larger.
  const auto topology_bytes = replication::encode_topology(layout, organ.name)->size();
  tcp.outbox_bytes = std::max(tcp.outbox_bytes, 8 * topology_bytes);
  tcp.tls = admission_->tls();
  tcp.has_datagrams = !options_.is_stream_only;
  const auto& limits = options_.limits;
  tcp.max_newcomers = limits.newcomers;
  tcp.max_newcomers_per_address = limits.newcomers_per_address;
  tcp.max_message_bytes = limits.message_bytes;
  tcp.max_connections = limits.places.hands + limits.places.watchers + limits.newcomers;
  tcp.plain_reply = replication::encode_goodbye(
      replication::EndReason::Version,
      "this server speaks TLS 1.3 only: use a client of its release, without --insecure-loopback");
  auto listening = net::TcpServer::listen(io_, tcp);
  if (!listening) return listening.error();
  tcp_ = std::move(*listening);
  connections_ = std::make_unique<crowd::GuestConnections>(*tcp_);

  if (const auto issued = admission_->issue_codes(tcp_->port()); !issued) return issued;
  auto page = BrowserPage::start(io_, options_, tcp_->port());
  if (!page) return page.error();
  page_ = std::move(*page);
  auto journal = open_journal(options_.journal, organ, layout, start_.continues,
                              start_.simulation.rules(), start_.key);
  if (!journal) return journal.error();
  journal_ = std::move(*journal);

  replication::ReplicatorOptions replication;
  replication.gate = admission_->gate();
  replication.has_datagrams = tcp_->has_datagrams();
  replication.lesson = options_.lesson;
  replication.course = std::move(start_.course);
  replication.fine_surface = replication::encode_fine_surface(organ.fine_surface);
  replication.haptic_laws = touch::haptic_laws(organ);
  replication.return_seconds = options_.access.return_seconds;
  replication.places = limits.places;
  const auto per_real_second = [this](std::uint32_t limit) {
    return static_cast<std::uint32_t>(limit * options_.pace);
  };
  replication.max_messages_per_second = per_real_second(limits.messages_per_second);
  replication.max_bytes_per_second = per_real_second(1000 * limits.kilobytes_per_second);
  replication.on_participants = [this](const auto& present, Tick tick) {
    note_participants(present, tick);
  };
  if (journal_) {
    replication.on_hand_report = [this](wire::HandRecord record) {
      journal_->record_hand(std::move(record));
    };
    replication.on_lesson = [this](wire::LessonEntry entry) {
      journal_->record_lesson(std::move(entry));
    };
  }
  replication.on_end_wanted = [this](const std::string& words) {
    goodbye_ = words;
    loop_->request_stop();
  };
  replication.on_pace = [this](float rate) {
    rate_ = rate;
    settle_rate();
  };
  if (options_.pace > 1)
    replication.on_followed = [this](Frame frame) { loop_->note_followed(frame); };
  replicator_ = std::make_unique<replication::Replicator>(
      *connections_, inbox_, layout, organ.name, organ::organ_hash(organ), std::move(replication));
  if (journal_) replicator_->set_recording(recording_state());
  restore_people();
  loop_ = std::make_unique<SimulationLoop>(simulation_, inbox_, handover_, journal_.get(),
                                           loop_options(),
                                           [this] { asio::post(io_, [this] { begin_end(); }); });
  return open_figures();
}

void Server::restore_people() {
  const auto& kept = admission_->places_before();
  const auto leave = [this](ParticipantSlot slot) {
    inbox_.note_hand();
    inbox_.push_leave(slot);
  };
  std::size_t restored = 0;
  for (const auto& who : start_.participants) {
    const auto place = std::ranges::find_if(
        kept, [&](const auto& one) { return one.slot == who.slot && one.name == who.name; });
    const bool may_return =
        place != kept.end() && replicator_->restore(who, place->token, place->code);
    restored += may_return;
    if (!may_return && who.slot.has_tools()) leave(who.slot);
  }
  for (const auto slot : start_.unnamed_hands) leave(slot);
  if (!start_.participants.empty())
    log::info("{} of {} participants may come back to their seats for {} s", restored,
              start_.participants.size(), options_.access.return_seconds);
}

void Server::settle_rate() {
  const float rate = is_awaiting_ ? 0 : rate_;
  loop_->set_rate(rate);
  is_paused_ = rate == 0;
  if (is_paused_) attend();
}

// While no frames come, people come and go all the same.
void Server::attend() {
  attention_.expires_after(kAttentionPeriod);
  attention_.async_wait([this](boost::system::error_code error) {
    if (error || !is_paused_ || is_ending_) return;
    if (journal_) replicator_->set_recording(recording_state());
    replicator_->attend();
    attend();
  });
}

void Server::note_participants(const std::vector<participants::Participant>& present, Tick tick) {
  if (is_awaiting_ && present.size() >= options_.awaited_people) {
    is_awaiting_ = false;
    settle_rate();
  }
  if (journal_) journal_->record_participants(present, tick);
  if (announcer_) announcer_->set_people(static_cast<int>(present.size()));
  if (sidecar_) sidecar_->set_people(present.size());
  std::vector<KeptPlace> places;
  for (const auto& who : present)
    if (const auto* token = replicator_->absences().find(who.slot))
      places.push_back({who.slot, who.name, *token, replicator_->code_of(who.slot)});
  admission_->keep_places(std::move(places));
}

// Who can only be reached from this machine has nothing to tell others, unless he is asked to.
void Server::announce() {
  const bool is_asked = !options_.announced_name.empty();
  if (options_.is_unannounced || (secure::is_loopback(options_.address) && !is_asked)) return;
  const auto& organ = simulation_.organ().name;
  announcer_ = std::make_unique<discovery::Announcer>(
      discovery::SessionNotice{
          .name = is_asked ? options_.announced_name : organ + " at " + machine_name(),
          .organ = organ,
          .people = 0,
          .needs_code = admission_->gate() != nullptr,
          .protocol = fmt::format("{}.{}", kProtocolMajor, kProtocolMinor)},
      tcp_->port());
}

step::TickDecisions Server::most_decisions() const {
  return options_.are_sweeps_chosen ? options_.decisions
                                    : simulation_.with_sweeps_for_organ(options_.decisions);
}

LoopOptions Server::loop_options() {
  const auto decisions = most_decisions();
  LoopOptions loop{.decisions = decisions, .pace = static_cast<float>(options_.pace)};
  if (options_.workers == 0) loop.most_workers = simulation_.workers();
  if (options_.seconds > 0)
    loop.tick_count = simulation_.current_tick() + ticks_of(options_.seconds);
  if (options_.has_fixed_decisions) return loop;
  control::RateLimits rate{.highest = decisions, .budget_us = options_.budget_ms * 1e3};
  // Nodes of the queue are not swept less than those outside it.
  if (decisions.boundary == world::Boundary::Graded) {
    rate.layer_sweeps =
        simulation_.context().solve.far_plan.with_sweeps(decisions.far_sweeps).sweeps;
    // Turns change a fast hand's force by 2 to 10 % where strain is averaged, and save a tenth of a
    // tick.
    const bool is_averaged = simulation_.state().strain_scheme == dynamics::StrainScheme::Explicit;
    if (!is_averaged) rate.far_interval = control::kLongestFarInterval;
    const bool is_asked = options_.are_sweeps_chosen || decisions.far_sweeps > 0;
    if (!is_asked) rate.most_far_sweeps = control::kMostFarSweeps;
  }
  loop.rate = rate;
  return loop;
}

Status Server::run() {
  const auto begin = monotonic_ns();
  boost::system::error_code ignored;
  for (const int signal : ending_signals()) signals_.add(signal, ignored);
  signals_.async_wait([this](boost::system::error_code error, int signal) {
    if (!error) on_signal(signal);
  });
  connections_->set_handler(replicator_->handler());
  tcp_->start(*connections_);
  if (!options_.ready_file.empty())
    if (const auto written =
            write_text_file(options_.ready_file, std::to_string(tcp_->port()) + "\n");
        !written)
      return written;
  log::info("{} ({} nodes) at {}:{}, Ctrl-C ends the session", simulation_.organ().name,
            simulation_.organ().mesh.node_count(), options_.address, tcp_->port());
  announce();
  watch_disk();
  std::fputs(admission_->invitation(tcp_->port()).c_str(), stdout);
  if (page_) std::fputs(page_->links().c_str(), stdout);
  std::fflush(stdout);
  newest_ns_ = monotonic_ns();
  is_awaiting_ = options_.awaited_people > 0;
  settle_rate();
  loop_->start();
  if (sidecar_) sidecar_->start();
  const Status ran = net::run(io_);
  if (!ran.ok()) {
    log::error("{}", ran.error().message);
    loop_->stop();  // what has been simulated is in the recording
  }
  wall_seconds_ = static_cast<double>(monotonic_ns() - begin) * 1e-9;
  const Status finished = finish();
  return ran.ok() ? finished : ran;
}

void Server::on_signal(int signal) {
  log::info("{}: ending the session; more signals are ignored for {} s", name_of_signal(signal),
            kEndSeconds);
  ignore_ending_signals();
  loop_->request_stop();
}

void Server::publish_frames() {
  if (is_ending_) return;
  if (journal_) replicator_->set_recording(recording_state());
  handover_.pop_all(frames_);
  if (!frames_.empty()) {
    newest_ = frames_.back();
    newest_ns_ = monotonic_ns();
  }
  replicator_->publish(frames_);
  warn_if_slow();
  tell_who_waits();
}

void Server::warn_if_slow() {
  if (frames_.empty()) return;
  const auto& frame = *frames_.back();
  const auto& rate = frame.figures.pace.rate;
  if (rate.time_rate > kSlowTimeRate || frame.tick < next_warning_) return;
  next_warning_ = frame.tick + kWarningPeriod;
  const auto tick_ms = frame.figures.pace.tick_median_us * 1e-3f;
  log::warn(
      "simulated time runs at {:.0f} % of real time: {}", 100 * rate.time_rate,
      tick_ms > kLongTickMs
          ? fmt::format("a tick takes {:.2f} ms (a smaller organ or more free processors help)",
                        tick_ms)
          : std::string("ticks are held up, perhaps by other programs"));
}

void Server::tell_who_waits() {
  if (frames_.empty()) return;
  const auto& frame = *frames_.back();
  if (frame.tick >= next_told_) {
    told_waiting_ = 0;
    next_told_ = frame.tick + kWarningPeriod;
  }
  const auto waiting = frame.figures.pace.rate.waiting_tools & ~told_waiting_;
  told_waiting_ |= waiting;
  for (const auto& who : replicator_->roster().list())
    for (int i = 0; i < kToolsPerHand && who.slot.has_tools(); ++i)
      if ((waiting >> tool_slot(who.slot, i).value & 1) != 0)
        log::info("{} is held back: tool {} moves faster than time can stay real", who.name, i + 1);
}

Status Server::open_figures() {
  if (options_.metrics_address.empty()) return {};
  auto listening = monitoring::FiguresServer::listen(
      io_, options_.metrics_address, options_.metrics_port,
      {[this] { return ill(); }, [this] { return not_ready(); }, [this] { return metrics(); }});
  if (!listening) return listening.error();
  figures_ = std::move(*listening);
  log::info("figures at {}:{}/metrics", options_.metrics_address, figures_->port());
  return {};
}

Status Server::open_sidecar() {
  if (!options_.is_agones) return {};
  const auto port = agones::sidecar_port(std::getenv(agones::kPortVariable));
  if (!port) return port.error();
  sidecar_port_ = *port;
  sidecar_ = std::make_unique<agones::Sidecar>(
      io_, *port, [this] { return ill(); }, [this] { return not_ready(); });
  return {};
}

wire::RecordingState Server::recording_state() const {
  auto state =
      journal_ ? journal_->state() : wire::RecordingState{wire::RecordingStatus::Off, 0, {}};
  if (state.status == wire::RecordingStatus::Whole) state.text = disk_.warning();
  return state;
}

void Server::watch_disk() {
  std::error_code failed;
  const std::filesystem::path path = options_.journal;
  if (!journal_ || !std::filesystem::is_regular_file(path, failed)) return;
  const auto recorded = std::filesystem::file_size(path, failed);
  const auto room = failed ? std::filesystem::space_info{}
                           : std::filesystem::space(std::filesystem::absolute(path), failed);
  if (!failed && disk_.add({static_cast<double>(monotonic_ns()) * 1e-9, recorded, room.available}))
    log::warn("{}: {}: free some space", options_.journal, disk_.warning());
  if (disk_.must_end())
    journal_->end_early(options_.journal +
                        ": the disk is nearly full; the file is whole so far; free some space");
  disk_timer_.expires_after(kDiskPeriod);
  disk_timer_.async_wait([this](boost::system::error_code error) {
    if (!error && !is_ending_) watch_disk();
  });
}

double Server::frame_age_s() const {
  return static_cast<double>(monotonic_ns() - newest_ns_) * 1e-9;
}

std::string Server::ill() const {
  if (is_paused_ || is_ending_ || frame_age_s() < kStillAfter_s) return {};
  return fmt::format("the simulation has shown nothing for {:.0f} s", frame_age_s());
}

std::string Server::not_ready() const {
  if (is_ending_) return "the session ends";
  if (!newest_ && !is_paused_) return "the simulation has not begun";
  return ill();
}

std::string Server::metrics() const {
  const auto* gate = admission_->gate();
  return to_exposition({.newest = newest_.get(),
                        .frame_age_s = frame_age_s(),
                        .is_paused = is_paused_,
                        .frames_lost = handover_.dropped(),
                        .people = replicator_->roster().list(),
                        .connections = tcp_->connection_count(),
                        .tcp = tcp_->counters(),
                        .datagrams = tcp_->datagram_counters(),
                        .replication = replicator_->counters(),
                        .inbox = inbox_.counters(),
                        .access = gate ? gate->counters() : access::GateCounters{},
                        .recording = recording_state(),
                        .recording_queued_bytes = journal_ ? journal_->queued_bytes() : 0,
                        .recording_syncs = journal_ ? journal_->sync_count() : 0,
                        .disk = disk_});
}

void Server::begin_end() {
  publish_frames();
  is_ending_ = true;
  ignore_ending_signals();
  announcer_.reset();
  disk_timer_.cancel();
  tcp_->stop_accepting();
  replicator_->begin_barrier(loop_->report().last_frame);
  wait_for(
      poll_, [this] { return replicator_->is_barrier_complete(); }, kBarrierDeadline,
      [this] { say_goodbye(); });
}

// Everybody hears whether the recording got its end.
void Server::say_goodbye() {
  barrier_ = replicator_->barrier_results();
  if (journal_) {
    closed_ = journal_->close();
    replicator_->set_recording(recording_state());
  }
  replicator_->end_all(replication::EndReason::ServerClosing, goodbye_);
  wait_for(
      poll_, [this] { return tcp_->connection_count() == 0; }, kGoodbyeDeadline,
      [this] { io_.stop(); });
}

Status Server::finish() {
  const Status written = write_end();
  if (page_) page_->stop();
  signals_.clear();  // which puts the default back
  ignore_ending_signals();
  // The cluster may take the machine away from here on.
  if (std::exchange(sidecar_, nullptr))
    if (const auto told = agones::shut_down(sidecar_port_); !told)
      log::warn("{}", told.error().message);
  return written;
}

// Closes the recording, and writes the figures of the run.
Status Server::write_end() {
  if (journal_ && !closed_) closed_ = journal_->close();
  const Status closed = closed_.value_or(Status{});
  const auto& report = loop_->report();
  std::size_t equal = 0;
  for (const auto& result : barrier_) equal += result.is_equal;
  log::info("{:.3f} s simulated in {:.3f} s, {} slow ticks, {} of {} replicas equal",
            static_cast<double>(report.ticks) / static_cast<double>(kTicksPerSecond), wall_seconds_,
            report.slow_ticks, equal, barrier_.size());
  if (handover_.dropped() > 0)
    log::warn("{} frames never reached the clients: the network thread was stuck",
              handover_.dropped());
  if (options_.summary_file.empty()) return closed;
  const wire::RecordingState not_recorded{
      .status = wire::RecordingStatus::Off, .frames_missing = 0, .text = {}};
  const Summary summary{
      .organ = simulation_.organ().name,
      .node_count = simulation_.organ().mesh.node_count(),
      .surface_vertex_count = simulation_.layout().vertex_count(),
      .wall_seconds = wall_seconds_,
      .journal = journal_ ? options_.journal : "none",
      .recording = journal_ ? journal_->state() : not_recorded,
      .frames_lost = handover_.dropped(),
      .loop = report,
      .barrier = barrier_,
      .replication = replicator_->counters(),
      .encoding = replicator_->encode_statistics(),
      .access = admission_->gate() ? admission_->gate()->counters() : access::GateCounters{},
      .tcp = tcp_->counters(),
      .datagrams = tcp_->datagram_counters(),
      .inbox = inbox_.counters()};
  const auto written = write_text_file(options_.summary_file, to_json(summary));
  return closed ? written : closed;
}

}  // namespace

Status run_server(const ServerOptions& options) {
  if (!options.access.revoke.empty() || !options.access.new_code.empty())
    return change_codes(options.access, options.address, options.port);
  if (const auto writable = check_end(options); !writable) return writable;
  auto admission =
      Admission::prepare(options.access, options.address, !options.resume_file.empty());
  if (!admission) return admission.error();
  auto start = start_session(options);
  if (!start) return start.error();
  const auto server = std::make_unique<Server>(options, std::move(*admission), std::move(*start));
  if (const auto opened = server->open(); !opened) return opened;
  return server->run();
}

}  // namespace trocar::app
