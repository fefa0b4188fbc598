#include "client/app/client.h"

#include <algorithm>
#include <chrono>
#include <csignal>
#include <fstream>
#include <thread>

#include "client/app/client_summary.h"
#include "client/app/picture.h"
#include "client/app/picture_pace.h"
#include "client/app/picture_series.h"
#include "client/app/start.h"
#include "client/device/device_list.h"
#include "client/device/returning_device.h"
#include "client/net/net_source.h"
#include "client/net/way_in.h"
#include "client/replay/recorded_hand.h"
#include "client/replay/replay_source.h"
#include "client/replica/client_messages.h"
#include "common/base/kept_file.h"
#include "common/base/log.h"
#include "common/base/signals.h"
#include "common/base/timing.h"
#include "common/lesson/lesson_texts.h"
#include "common/tool/script.h"

namespace trocar::app {
namespace {

volatile std::sig_atomic_t stop_requested = 0;

constexpr std::uint64_t kPollNs = 4'000'000;  // samples of a mouse leave every 8 ms
// A script answers each frame soon: a server may wait for it (trocar-server --pace).
constexpr std::uint64_t kScriptPollNs = 1'000'000;
constexpr std::uint64_t kGoodbyeNs = 2'500'000'000;  // longer than its source waits for that

class Run {
 public:
  Run(const ClientOptions& options, replica::SessionSource& source, Hands& hands,
      replay::PairedSource* pair = nullptr)
      : options_(options),
        source_(source),
        hands_(hands),
        pair_(pair),
        replica_([&source](const proto::Envelope& message) { return source.send(message); }),
        second_([pair](const proto::Envelope& message) { return pair->half(1).send(message); }),
        pace_(options.pictures_per_second > 0        ? options.pictures_per_second
              : options.display == Display::Headless ? 15
                                                     : 60) {
    replica_.corrupt_delta(options.corrupt_frame);
  }

  Result<ExitCode> run();
  void offer_ways_on() { practises_ = true; }
  // Returns what the person wants who has left a lesson.
  std::optional<ui::AfterLesson> after_lesson() const {
    return picture_ ? picture_->lesson().wish : std::nullopt;
  }

 private:
  Status step(std::uint64_t now_ns);
  Status poll();
  void note_recording();
  void measure(std::uint64_t now_ns);
  void use_marks();
  bool is_over(std::uint64_t now_ns);
  bool stays_open() const;
  Status take_screenshot(std::uint64_t now_ns, bool is_last);
  Status write_summary() const;
  Result<ExitCode> conclude(const Status& outcome);

  const ClientOptions& options_;
  replica::SessionSource& source_;
  Hands& hands_;
  replay::PairedSource* pair_;  // null: there is one session
  replica::Replica replica_;
  replica::Replica second_;  // of the pair
  std::unique_ptr<Picture> picture_;
  PicturePace pace_;
  std::uint64_t start_ns_ = 0;
  std::uint64_t live_ns_ = 0;  // when the first frame was there
  Tick live_tick_ = 0;         // that it showed
  bool has_screenshot_ = false, has_marked_ = false, has_returned_ = false;
  bool has_answered_ = false;
  std::string exit_reason_;
  replica::TimeDistribution round_trip_, surface_age_, hand_to_visible_, cut_to_visible_;
  wire::RecordingStatus recording_told_ = wire::RecordingStatus::Unknown;
  bool practises_ = false;  // alone
  std::uint64_t last_change_us_ = 0;
  double last_round_trip_seconds_ = 0;
};

// A recording that is not what it says stops, and one beside it goes on.
Status Run::poll() {
  source_.poll(replica_);
  if (pair_ == nullptr) {
    if (replica_.fault().ok()) return {};
    return Error{replica_.fault().error().code,
                 source_.name() + ": " + replica_.fault().error().message};
  }
  pair_->poll_second(second_);
  if (!replica_.fault().ok()) pair_->stop(0, replica_.fault().error().message);
  if (!second_.fault().ok()) pair_->stop(1, second_.fault().error().message);
  return {};
}

Status Run::step(std::uint64_t now_ns) {
  if (const auto polled = poll(); !polled) return polled.error();
  if (live_ns_ == 0 && replica_.newest() != nullptr) {
    live_ns_ = now_ns;
    live_tick_ = replica_.newest()->tick;
    log::info("in the session: {}, {} surface vertices", replica_.topology().organ_name,
              replica_.topology().rest_positions.size());
  }
  note_recording();
  if (const auto sent = hands_.send_due(replica_, source_, now_ns); !sent) return sent.error();
  use_marks();
  measure(now_ns);
  if (picture_) picture_->observe(replica_, hands_, now_ns);
  if (picture_ && pace_.is_due(now_ns)) {
    picture_->draw(replica_, source_, hands_, now_ns);
    pace_.note_picture(now_ns, monotonic_ns());
    picture_->set_fineness(pace_.fineness());
    if (const auto taken = take_screenshot(now_ns, false); !taken) return taken.error();
  }
  return {};
}

// A person without a picture, or who looks elsewhere, hears it too.
void Run::note_recording() {
  const auto& recording = replica_.told().recording();
  if (recording.is_damaged() && recording.status != recording_told_)
    log::warn("{}", recording.text);
  recording_told_ = recording.status;
}

// The first second, in which clocks and paths are found, does not count.
void Run::measure(std::uint64_t now_ns) {
  if (live_ns_ == 0 || now_ns - live_ns_ < 1'000'000'000) return;
  const auto statistics = source_.statistics();
  if (statistics.round_trip_seconds != last_round_trip_seconds_) {
    last_round_trip_seconds_ = statistics.round_trip_seconds;
    round_trip_.add(last_round_trip_seconds_ * 1e3);
  }
  if (!statistics.has_server_clock || replica_.barrier()) return;
  const auto server_now_us = static_cast<double>(now_ns) * 1e-3 + statistics.server_offset_us;
  if (const auto age = replica_.age_ms(server_now_us)) {
    surface_age_.add(*age);
    const double way_ms = *age + last_round_trip_seconds_ * 1e3 / 2;
    const auto likely_ns = now_ns - static_cast<std::uint64_t>(std::max(0.0, way_ms) * 1e6);
    if (const auto echo = hands_.observe_echo_ms(replica_, likely_ns, now_ns))
      hand_to_visible_.add(*echo);
  }
  const auto change_us = replica_.shown_change_us();
  if (change_us != last_change_us_)
    cut_to_visible_.add((server_now_us - static_cast<double>(change_us)) * 1e-3);
  last_change_us_ = change_us;
}

// A client does this by itself, by simulated time as scripts do.
void Run::use_marks() {
  if (live_ns_ == 0 || replica_.newest() == nullptr) return;
  const Tick newest = replica_.newest()->tick;
  const double seconds = static_cast<double>(newest - std::min(newest, live_tick_)) /
                         static_cast<double>(kTicksPerSecond);
  const auto is_due = [&](double at) { return at >= 0 && seconds >= at; };
  if (!has_answered_ && is_due(options_.answer_at))
    has_answered_ = replica::send_lesson_wish(source_, replica::LessonWish::Answer);
  if (!has_marked_ && is_due(options_.mark_at)) has_marked_ = replica::ask_for_mark(source_, false);
  if (!has_returned_ && is_due(options_.return_at))
    has_returned_ = replica::ask_for_mark(source_, true);
}

// A window that closed by itself would leave a person without a word: it says what happened, over
// the last picture, until it is closed. Where the start screen comes back, that says it.
bool Run::stays_open() const {
  return options_.display == Display::Window && picture_ && !picture_->should_close() &&
         stop_requested == 0 && options_.seconds == 0 && !wants_start_screen(options_);
}

bool Run::is_over(std::uint64_t now_ns) {
  if (source_.state() == replica::SourceState::Closed) {
    if (exit_reason_.empty()) log::info("the session is over: {}", source_.close_reason().text);
    exit_reason_ = source_.close_reason().text;
    return !stays_open();
  }
  if (stop_requested != 0)
    exit_reason_ = "stopped by a signal";
  else if (picture_ && picture_->should_close())
    exit_reason_ = "window closed";
  else if (options_.seconds > 0 && live_ns_ != 0 &&
           static_cast<double>(now_ns - live_ns_) * 1e-9 >= options_.seconds)
    exit_reason_ = "end of --seconds";
  return !exit_reason_.empty();
}

Status Run::take_screenshot(std::uint64_t now_ns, bool is_last) {
  if (options_.screenshot_file.empty() || has_screenshot_ || !picture_ || picture_->count() == 0)
    return {};
  const double at = options_.screenshot_at;
  const bool is_due =
      at >= 0 && live_ns_ != 0 && static_cast<double>(now_ns - live_ns_) * 1e-9 >= at;
  if (!is_due && !is_last) return {};
  has_screenshot_ = true;
  return picture_->save(options_.screenshot_file);
}

Status Run::write_summary() const {
  if (options_.summary_file.empty()) return {};
  ClientSummary summary;
  summary.name = options_.name;
  summary.role = source_.playback() != nullptr ? "replay" : replica::name_of(options_.role);
  summary.exit_reason = exit_reason_;
  summary.wall_seconds = static_cast<double>(monotonic_ns() - start_ns_) * 1e-9;
  summary.pictures = picture_ ? picture_->count() : 0;
  const auto statistics = source_.statistics();
  summary.round_trip = round_trip_;
  summary.surface_age = surface_age_;
  summary.hand_to_visible = hand_to_visible_;
  summary.cut_to_visible = cut_to_visible_;
  summary.hands = hands_.figures();
  std::ofstream file(options_.summary_file);
  file << to_json(summary, replica_, statistics);
  file.close();
  if (!file)
    return Error{ErrorCode::ResourceMissing,
                 options_.summary_file + ": cannot write the summary; does the folder exist?"};
  return {};
}

Result<ExitCode> Run::run() {
  start_ns_ = monotonic_ns();
  if (options_.display != Display::None) {
    auto picture = Picture::make(options_, "Trocar: " + source_.name());
    if (!picture) return picture.error();
    picture_ = std::move(*picture);
    if (practises_) picture_->lesson().offers_ways_on = true;
    if (pair_ != nullptr) picture_->stand_beside(options_, *pair_, second_);
    // Nobody else needs the processors while a recording plays; who asks for a rate gets it.
    if (picture_->is_software() && source_.playback() == nullptr &&
        options_.pictures_per_second == 0)
      pace_.yield();
  }
  for (;;) {
    const std::uint64_t now = monotonic_ns();
    if (const auto stepped = step(now); !stepped) return conclude(stepped);
    if (is_over(now)) return conclude({});
    const std::uint64_t after = monotonic_ns();
    std::uint64_t wake = after + (hands_.has_script() ? kScriptPollNs : kPollNs);
    if (picture_) wake = std::clamp(pace_.next_ns(), after, wake);
    std::this_thread::sleep_for(std::chrono::nanoseconds(wake - after));
  }
}

Result<ExitCode> Run::conclude(const Status& outcome) {
  if (!outcome.ok()) exit_reason_ = outcome.error().message;
  const auto traces = hands_.let_go();  // before the network is waited for
  const bool we_leave = source_.state() != replica::SourceState::Closed;
  if (we_leave) {
    source_.close(exit_reason_);
    const std::uint64_t until = monotonic_ns() + kGoodbyeNs;
    while (source_.state() != replica::SourceState::Closed && monotonic_ns() < until) {
      source_.poll(replica_);
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
  }
  const auto taken = take_screenshot(monotonic_ns(), true);
  auto written = write_trace(options_.trace_file, traces);
  if (const auto summarised = write_summary(); written.ok()) written = summarised;
  if (!outcome.ok()) return outcome.error();
  if (!taken) return taken.error();
  if (!written) return written.error();
  if (we_leave) {
    log::info("left: {}", exit_reason_);
    return ExitCode::Ok;
  }
  const replica::CloseReason reason{source_.close_reason().kind, exit_reason_};
  if (const auto ending = net::ending_of(reason); !ending) return ending.error();
  log::info("session ended: {}", exit_reason_);
  return ExitCode::Ok;
}

}  // namespace

void install_signal_handlers() {
  for (const int signal : ending_signals())
    std::signal(signal, [](int) {
      stop_requested = 1;
      ignore_ending_signals();
    });
}

Result<ExitCode> run_with_source(const ClientOptions& options, replica::SessionSource& source,
                                 Hands& hands, std::optional<ui::AfterLesson>* after_lesson) {
  Run run(options, source, hands);
  if (after_lesson != nullptr) run.offer_ways_on();
  auto ran = run.run();
  if (after_lesson != nullptr) *after_lesson = run.after_lesson();
  return ran;
}

Result<ExitCode> run_pair(const ClientOptions& options, replay::PairedSource& pair) {
  Hands hands;
  return Run(options, pair, hands, &pair).run();
}

bool is_stop_requested() {
  return stop_requested != 0;
}

namespace {

Result<std::unique_ptr<device::HapticDevice>> open_device(const std::string& name) {
  auto opened = device::ReturningDevice::open([name] { return device::open_device(name); });
  if (!opened) return Error{opened.error().code, "--device: " + opened.error().message};
  return opened;
}

Result<Hands> open_devices(const ClientOptions& options) {
  std::vector<std::unique_ptr<FeltHand>> hands;
  for (const auto& name : options.devices) {
    auto opened = open_device(name);
    if (!opened) return opened.error();
    FeltSettings settings;
    settings.tool = options.tool_of(hands.size());
    settings.port_m = options.port_of(hands.size());
    settings.scale = {options.device_motion, options.device_force};
    settings.has_trace = !options.trace_file.empty();
    hands.push_back(std::make_unique<FeltHand>(std::move(*opened), settings));
  }
  return Hands::felt(std::move(hands));
}

// Each device feels one hand of the recording.
Result<Hands> open_replayed(const ClientOptions& options) {
  std::vector<std::unique_ptr<FeltReplay>> hands;
  for (const auto& chosen : options.feels) {
    auto hand = replay::read_recorded_hand(options.replay_file, chosen.name, chosen.tool);
    if (!hand) return Error{hand.error().code, "--feel: " + hand.error().message};
    auto opened = open_device(options.devices[hands.size()]);
    if (!opened) return opened.error();
    haptics::PlaybackSettings settings;
    settings.scale = {options.device_motion, options.device_force};
    settings.pull_n_m = options.feel_pull_n_m;
    hands.push_back(std::make_unique<FeltReplay>(std::move(*opened), std::move(*hand), settings,
                                                 !options.trace_file.empty()));
  }
  return Hands::replayed(std::move(hands));
}

// Files that are written at the end must not fail only then.
Status check_end(const ClientOptions& options) {
  for (const auto& [key, file] : {std::pair{"--screenshot", &options.screenshot_file},
                                  {"--summary", &options.summary_file},
                                  {"--hand-trace", &options.trace_file}})
    if (!file->empty())
      if (auto fine = check_output(key, *file); !fine) return fine;
  return {};
}

Result<ExitCode> run_chosen(const ClientOptions& options,
                            std::optional<ui::AfterLesson>* after_lesson) {
  Hands hands;
  if (!options.series_folder.empty()) {
    if (const auto written = write_picture_series(options); !written) return written.error();
    return ExitCode::Ok;
  }
  if (!options.beside_file.empty()) {
    auto pair = replay::PairedSource::open(options.replay_file, options.beside_file, options.align);
    if (!pair) return pair.error();
    return run_pair(options, **pair);
  }
  if (!options.replay_file.empty()) {
    auto source = replay::ReplaySource::open(options.replay_file);
    if (!source) return source.error();
    auto replayed = open_replayed(options);
    if (!replayed) return replayed.error();
    return run_with_source(options, **source, *replayed);
  }
  if (!options.script_file.empty()) {
    auto script = tool::parse_script(options.script_file);
    if (!script) return script.error();
    hands = Hands::scripted(std::move(*script));
  } else if (!options.devices.empty()) {
    auto felt = open_devices(options);
    if (!felt) return felt.error();
    hands = std::move(*felt);
  } else if (options.display == Display::Window && options.has_tools()) {
    hands = Hands::mouse(options.instruments(), options.tool_of(0), options.mouse_hands);
  }
  net::NetSourceOptions connection;
  if (const auto parsed = net::parse_server_address(options.server, connection); !parsed)
    return Error{parsed.error().code, "--server: " + parsed.error().message};
  const net::WayIn way{options.join, options.ca_file, options.is_insecure, options.role};
  if (const auto set = net::set_security(way, connection); !set) return set.error();
  connection.connect_deadline =
      std::chrono::milliseconds(static_cast<std::int64_t>(options.wait_s * 1e3));
  connection.participant_name = options.name;
  connection.wants_datagrams = options.wants_datagrams;
  connection.role = static_cast<int>(options.role);
  connection.tools = hands.shapes();
  connection.hands = hands.line();
  net::NetSource source(std::move(connection));
  return run_with_source(options, source, hands, after_lesson);
}

// The lesson that a person wants who has left the one that `settings` gave; nothing: none.
std::optional<std::string> wanted_lesson(const OwnServer::Settings& settings,
                                         ui::AfterLesson after_lesson) {
  if (after_lesson == ui::AfterLesson::Leave) return std::nullopt;
  if (after_lesson == ui::AfterLesson::Repeat) return settings.lesson;
  const auto all = lesson::lesson_texts();
  auto next = std::ranges::find(all, settings.lesson, &lesson::LessonText::name);
  if (next != all.end()) ++next;
  return next == all.end() ? all.front().name : next->name;
}

}  // namespace

// Who hosts a lesson comes back to it from a session, and ends it there.
Result<ExitCode> run_client(const ClientOptions& options) {
  if (const auto writable = check_end(options); !writable) return writable.error();
  if (!wants_start_screen(options)) return run_chosen(options, nullptr);
  ClientOptions chosen = options;
  std::unique_ptr<OwnServer> own;
  std::optional<std::string> lesson;  // to practise at once
  for (std::string message;;) {
    auto choice = choose_session(chosen, message, own, lesson);
    if (!choice) return choice.error();
    if (!*choice) return ExitCode::Ok;
    chosen = std::move(**choice);
    std::optional<ui::AfterLesson> after_lesson;
    const bool practises =
        own && !own->settings().is_for_network && !own->settings().lesson.empty();
    auto ran = run_chosen(chosen, practises ? &after_lesson : nullptr);
    lesson.reset();
    if (own && after_lesson) lesson = wanted_lesson(own->settings(), *after_lesson);
    if (own && !own->settings().is_for_network) own.reset();
    if (is_stop_requested() || (ran && !own && !after_lesson)) return ran;
    message = ran ? "" : ran.error().message;
    if (!ran) log::warn("{}", message);
  }
}

}  // namespace trocar::app
