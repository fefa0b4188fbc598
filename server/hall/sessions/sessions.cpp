#include "server/hall/sessions/sessions.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/udp.hpp>
#include <chrono>
#include <cmath>
#include <csignal>
#include <ctime>
#include <fstream>
#include <type_traits>

#include "common/base/log.h"
#include "common/base/printable.h"
#include "common/base/spawn.h"
#include "common/base/timing.h"
#include "common/secure/link_file.h"
#include "common/secure/private_files.h"
#include "common/wire/role.h"
#include "server/hall/sessions/figures_probe.h"

namespace trocar::hall {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::milliseconds kLookPeriod{250};
constexpr double kProbePeriod_s = 0.5;
constexpr double kKillAfter_s = 60;  // of a server that was told to end
constexpr double kSettled_s = 3;     // after the start, before anything is measured
constexpr double kWindow_s = 5;      // over which processor time is measured
// An idle session tells little of its kind: so many windows with tools at work are needed.
constexpr int kLeastBusyWindows = 3;
constexpr double kPeakStep = 0.05;      // cores; a smaller growth is not written down
constexpr double kForgetting = 0.8;     // a kind of session that takes less now is believed slowly
constexpr std::size_t kLogTail = 4096;  // bytes
constexpr std::size_t kMostFailureText = 300;
constexpr std::size_t kTrialBytes = 64 * 1024;
constexpr std::size_t kMostOfferInName = 28;
constexpr int kMostFolderTries = 10;

double now_s() {
  return static_cast<double>(monotonic_ns()) * 1e-9;
}

template <typename Protocol>
bool is_free(const std::string& address, std::uint16_t port) {
  asio::io_context context;
  boost::system::error_code error;
  const auto ip = asio::ip::make_address(address, error);
  if (error) return true;  // the server says what is wrong with it
  typename Protocol::socket socket(context);
  socket.open(typename Protocol::endpoint(ip, port).protocol(), error);
  if constexpr (std::is_same_v<Protocol, asio::ip::tcp>)
    if (!error) socket.set_option(asio::socket_base::reuse_address(true), error);
  if (!error) socket.bind(typename Protocol::endpoint(ip, port), error);
  return !error;
}

// The message of a line of a log, which is text or JSON.
std::string message_of(const std::string& line) {
  const auto json = Json::parse(line, nullptr, false);
  if (!json.is_object()) return line;
  const auto message = json.find("message");
  return message != json.end() && message->is_string() ? message->get<std::string>() : line;
}

// The last line that a server has said.
std::string last_words(const fs::path& log) {
  std::ifstream file(log, std::ios::binary | std::ios::ate);
  const auto size = static_cast<std::streamoff>(file.tellg());
  if (!file || size <= 0) return "it has said nothing";
  file.seekg(std::max<std::streamoff>(0, size - static_cast<std::streamoff>(kLogTail)));
  std::string last = "it has said nothing";
  for (std::string line; std::getline(file, line);)
    if (!line.empty()) last = line;
  return printable(message_of(last), kMostFailureText);
}

// Says whether the folder of a recording still takes files. A server on a full disk can say
// nothing: its log is on that disk.
Status check_folder(const fs::path& folder) {
  const auto trial = folder / "trial";
  const auto written = secure::write_private_file(trial, std::string(kTrialBytes, ' '));
  if (!written) return written;
  std::error_code ignored;
  fs::remove(trial, ignored);
  return {};
}

bool has_content(const fs::path& file) {
  std::error_code failed;
  return fs::is_regular_file(file, failed) && fs::file_size(file, failed) > 0 && !failed;
}

bool is_alive(const Session& session) {
  return session.state != SessionState::Ended && session.state != SessionState::Failed;
}

}  // namespace

Result<std::unique_ptr<Sessions>> Sessions::open(asio::io_context& context, HallConfig config,
                                                 fs::path program) {
  std::error_code failed;
  fs::create_directories(config.recordings_folder, failed);
  if (failed)
    return Error{ErrorCode::ResourceMissing, config.recordings_folder.string() +
                                                 ": cannot be made (" + failed.message() +
                                                 "): name another folder with the key recordings"};
  config.recordings_folder = fs::absolute(config.recordings_folder);
  config.state_folder = fs::absolute(config.state_folder);
  auto file = StateFile::open(config.state_folder);
  if (!file) return file.error();
  auto state = file->read();
  if (!state) return state.error();
  return std::unique_ptr<Sessions>(new Sessions(context, std::move(config), std::move(program),
                                                std::move(*file), std::move(*state)));
}

Sessions::Sessions(asio::io_context& context, HallConfig config, fs::path program, StateFile file,
                   HallState state)
    : context_(context),
      config_(std::move(config)),
      program_(std::move(program)),
      file_(std::move(file)),
      measured_cores_(std::move(state.measured_cores)),
      timer_(context) {
  for (auto& saved : state.sessions) take_over(std::move(saved));
  save();
}

void Sessions::take_over(SavedSession saved) {
  const auto session = std::make_shared<Session>();
  static_cast<SavedSession&>(*session) = std::move(saved);
  // State files of before do not say it.
  if (!session->offer.cores)
    if (const auto* offer = config_.find_offer(session->offer.name))
      session->offer.cores = offer->cores;
  session->server = ServerProcess::find(session->process, session->arguments);
  sessions_.push_back(session);
  if (session->server) {
    ++counters_.found;
    log::info("{}: found again, process {}", session->name, session->process.pid);
    if (!session->is_ending) return;
    session->state = SessionState::Ending;
    session->kill_at_s = now_s() + kKillAfter_s;
  } else {
    on_ending(*session, {});
  }
}

void Sessions::watch() {
  if (is_stopping_) return;
  look();
  timer_.expires_after(kLookPeriod);
  timer_.async_wait([this](boost::system::error_code error) {
    if (!error) watch();
  });
}

void Sessions::stop() {
  is_stopping_ = true;
  timer_.cancel();
}

std::shared_ptr<const Session> Sessions::find(const std::string& name) const {
  const auto found =
      std::ranges::find_if(sessions_, [&](const auto& s) { return s->name == name; });
  return found == sessions_.end() ? nullptr : *found;
}

double Sessions::expected(const Offer& offer) const {
  const auto measured = measured_cores_.find(offer.name);
  return expected_cores(
      offer.cores,
      measured == measured_cores_.end() ? std::nullopt : std::optional(measured->second),
      offer.workers);
}

std::vector<Load> Sessions::loads() const {
  // One that has just begun has no second yet to be judged by.
  const auto is_overloaded = [](const Session& session) {
    return session.state == SessionState::Running && session.figures.is_overloaded &&
           session.figures.tick_p99_s > 0;
  };
  std::vector<Load> all;
  for (const auto& session : sessions_)
    if (is_alive(*session))
      all.push_back({.name = session->name,
                     .cores = std::max(expected(session->offer), session->peak_cores),
                     .is_overloaded = is_overloaded(*session),
                     .tick_p99_s = session->figures.tick_p99_s});
  return all;
}

double Sessions::taken_cores() const {
  double taken = 0;
  for (const auto& load : loads()) taken += load.cores;
  return taken;
}

Status Sessions::check_room(const Offer& offer) const {
  const auto running = loads();
  if (running.size() >= static_cast<std::size_t>(config_.most_sessions))
    return Error{ErrorCode::Refused,
                 fmt::format("{} sessions run, and most-sessions allows {}: end one first",
                             running.size(), config_.most_sessions)};
  return admit(running, offer.name, expected(offer), config_.cores);
}

std::string Sessions::free_name(const std::string& offer) const {
  for (int i = 1;; ++i)
    if (auto name = fmt::format("{}-{}", offer.substr(0, kMostOfferInName), i); !find(name))
      return name;
}

Status Sessions::find_ports(Session& session) const {
  for (int i = 0; i < std::min(config_.ports.count(), config_.figures_ports.count()); ++i) {
    const auto port = static_cast<std::uint16_t>(config_.ports.first + i);
    const auto figures_port = static_cast<std::uint16_t>(config_.figures_ports.first + i);
    const bool is_taken = std::ranges::any_of(
        sessions_, [&](const auto& other) { return is_alive(*other) && other->port == port; });
    const auto& address = config_.sessions_address;
    if (is_taken || !is_free<asio::ip::tcp>(address, port) ||
        !is_free<asio::ip::udp>(address, port) ||
        !is_free<asio::ip::tcp>("127.0.0.1", figures_port))
      continue;
    session.port = port;
    session.figures_port = figures_port;
    return {};
  }
  return Error{ErrorCode::Refused,
               fmt::format("no port of {} to {} is free: end a session, or widen ports and "
                           "figures-ports",
                           config_.ports.first, config_.ports.last)};
}

Status Sessions::make_folder(Session& session) const {
  const auto stem =
      fmt::format("{:%Y%m%dT%H%M%SZ}-{}", fmt::gmtime(std::time(nullptr)), session.name);
  std::error_code failed;
  for (int i = 1; i <= kMostFolderTries && !failed; ++i) {
    session.folder = config_.recordings_folder / (i == 1 ? stem : fmt::format("{}.{}", stem, i));
    if (fs::create_directory(session.folder, failed)) return {};
  }
  return Error{ErrorCode::ResourceMissing, session.folder.string() + ": cannot be made (" +
                                               (failed ? failed.message() : "it is there") +
                                               "): look at the folder of recordings"};
}

Status Sessions::launch(Session& session) {
  session.arguments = server_arguments(session, config_);
  auto started = ServerProcess::start(program_, session.arguments, log_of(session));
  if (!started) {
    const auto fits = check_folder(session.folder);
    return fits ? started.error() : fits.error();
  }
  session.server.emplace(std::move(*started));
  session.process = session.server->id();
  session.figures = {};
  session.window_from_s = 0;
  return {};
}

Result<std::shared_ptr<const Session>> Sessions::start(const StartRequest& request) {
  const auto refused = [this](const Error& error) {
    ++counters_.refused;
    log::info("refused: {}", error.message);
    return error;
  };
  const auto* offer = config_.find_offer(request.offer);
  if (offer == nullptr)
    return refused({ErrorCode::Refused,
                    request.offer + " is not among what may be started: " + config_.list_offers()});
  if (!request.name.empty() && find(request.name))
    return refused({ErrorCode::Refused, "a session is called " + request.name +
                                            " already: choose another name, or end it first"});
  if (const auto fits = check_room(*offer); !fits) return refused(fits.error());
  const auto session = std::make_shared<Session>();
  session->name = request.name.empty() ? free_name(offer->name) : request.name;
  session->offer = *offer;
  session->since_unix_s = static_cast<std::int64_t>(std::time(nullptr));
  if (const auto found = find_ports(*session); !found) return refused(found.error());
  if (const auto made = make_folder(*session); !made) return refused(made.error());
  session->recordings = {"session.mcap"};
  if (const auto launched = launch(*session); !launched) return refused(launched.error());
  ++counters_.started;
  sessions_.push_back(session);
  save();
  log::info("{}: started, {} at port {}, process {}", session->name, offer->name, session->port,
            session->process.pid);
  return std::shared_ptr<const Session>(session);
}

Result<std::shared_ptr<const Session>> Sessions::end(const std::string& name) {
  const auto found =
      std::ranges::find_if(sessions_, [&](const auto& s) { return s->name == name; });
  if (found == sessions_.end())
    return Error{ErrorCode::Refused, "no session is called " + printable(name, 64) +
                                         ": trocar-hall list names those that run"};
  const auto session = *found;
  if (session->state == SessionState::Failed || !session->server) {
    finish(*session);
    std::erase(sessions_, session);
  } else if (session->state != SessionState::Ending) {
    session->state = SessionState::Ending;
    session->is_ending = true;
    session->kill_at_s = now_s() + kKillAfter_s;
    session->server->signal(SIGTERM);
    log::info("{}: told to end", session->name);
  }
  save();
  return std::shared_ptr<const Session>(session);
}

void Sessions::end_all() {
  const auto all = sessions_;  // end() takes some of them out
  for (const auto& session : all) (void)end(session->name);
}

void Sessions::look() {
  for (const auto& session : sessions_) look_at(session);
  if (std::erase_if(sessions_, [](const auto& s) { return s->state == SessionState::Ended; }) > 0)
    save();
}

void Sessions::look_at(const std::shared_ptr<Session>& session) {
  if (!is_alive(*session)) return;
  if (session->server) {
    if (const auto ending = session->server->poll()) {
      session->server.reset();
      on_ending(*session, *ending);
      save();
      return;
    }
  }
  if (session->state == SessionState::Ending) {
    if (session->server && now_s() > session->kill_at_s) {
      log::error("{}: has not ended within {:.0f} s and is killed; {} has no end", session->name,
                 kKillAfter_s, newest_recording(*session).string());
      session->server->signal(SIGKILL);
    }
    return;
  }
  if (!session->server) {
    if (now_s() < session->restart_at_s) return;
    if (const auto launched = launch(*session); !launched)
      fail(*session, launched.error().message);
    else
      log::info("{}: goes on, process {}", session->name, session->process.pid);
    save();
    return;
  }
  if (session->is_probed || now_s() < session->probe_at_s) return;
  session->is_probed = true;
  session->probe_at_s = now_s() + kProbePeriod_s;
  spawn(context_.get_executor(), probe(session), rethrow);
}

void Sessions::on_ending(Session& session, const ServerProcess::Ending& ending) {
  session.process = {};
  std::error_code ignored;
  const bool is_in_order = fs::exists(summary_of(session), ignored);
  if (session.state == SessionState::Ending || session.is_ending) return finish(session);
  if (ending.exit_code.value_or(-1) == 0 || (!ending.exit_code && is_in_order))
    return finish(session);
  if (ending.exit_code) {
    const auto fits = check_folder(session.folder);
    return fail(session, fits ? last_words(log_of(session)) : fits.error().message);
  }
  const auto why =
      ending.signal != 0 ? fmt::format("was killed by signal {}", ending.signal) : "has vanished";
  if (session.restarts >= config_.restarts)
    return fail(session, fmt::format("{} after {} restarts, see {}", why, session.restarts,
                                     log_of(session).string()));
  prepare_restart(session, why);
}

void Sessions::prepare_restart(Session& session, const std::string& why) {
  ++session.restarts;
  ++counters_.restarted;
  session.state = SessionState::Starting;
  // The first time at once; then it may be the machine that is ill.
  session.restart_at_s = session.restarts == 1 ? 0 : now_s() + std::exp2(session.restarts - 1);
  // A server that was killed before its recording had begun leaves none.
  while (!session.recordings.empty() && !has_content(newest_recording(session)))
    session.recordings.pop_back();
  log::warn("{}: the server {}; restart {} of {}{}", session.name, why, session.restarts,
            config_.restarts,
            session.recordings.empty() ? ", from its beginning"
                                       : " from " + newest_recording(session).string());
  session.recordings.push_back(session.recordings.empty()
                                   ? "session.mcap"
                                   : fmt::format("session-{}.mcap", session.restarts + 1));
}

void Sessions::fail(Session& session, const std::string& why) {
  ++counters_.failed;
  session.state = SessionState::Failed;
  session.failure = why;
  session.server.reset();
  log::error("{}: has failed: {}", session.name, why);
}

void Sessions::finish(Session& session) {
  session.state = SessionState::Ended;
  session.server.reset();
  if (session.busy_windows >= kLeastBusyWindows) {
    auto& measured = measured_cores_[session.offer.name];
    measured = std::max(session.peak_cores, kForgetting * measured);
  }
  log::info("{}: has ended, {}", session.name, newest_recording(session).string());
}

asio::awaitable<void> Sessions::probe(std::shared_ptr<Session> session) {
  const auto port = session->figures_port;
  const auto ready = co_await get_page(port, "/readyz");
  if (ready && session->state == SessionState::Starting && session->server && !is_stopping_)
    become_running(*session);
  if (session->state == SessionState::Running) {
    const auto text = co_await get_page(port, "/metrics");
    if (text && session->state == SessionState::Running && session->server && !is_stopping_) {
      session->answered_at_s = now_s();
      session->figures = read_figures(*text);
      measure(*session);
    }
  }
  session->is_probed = false;
}

void Sessions::become_running(Session& session) {
  session.state = SessionState::Running;
  session.running_since_s = session.answered_at_s = now_s();
  // Codes from before a restart are good still.
  if (session.codes.empty())
    for (const auto& role : wire::kRoles)
      if (const auto code = secure::read_link_file(session.port, role.name))
        session.codes[role.name] = secure::to_text(*code);
  log::info("{}: runs, {} at {}", session.name, session.offer.organ, address_of(session, config_));
  save();
}

void Sessions::measure(Session& session) {
  const auto processor_s = session.server->processor_seconds();
  const double at_s = now_s();
  if (!processor_s || at_s - session.running_since_s < kSettled_s) return;
  session.has_acted |= session.figures.claims > 0;
  const double span_s = at_s - session.window_from_s;
  if (session.window_from_s > 0 && span_s < kWindow_s) return;
  if (session.window_from_s > 0) {
    const auto& figures = session.figures;
    session.cores = measured_cores(*processor_s - session.window_processor_s, span_s,
                                   figures.is_paused ? 0 : figures.tick_median_s);
    const bool is_new = session.peak_cores == 0 || session.cores > session.peak_cores + kPeakStep;
    session.busy_windows += session.has_acted;
    session.peak_cores = std::max(session.peak_cores, session.cores);
    if (is_new || session.has_acted) save();
  }
  session.window_from_s = at_s;
  session.window_processor_s = *processor_s;
  session.has_acted = false;
}

void Sessions::save() {
  HallState state;
  state.measured_cores = measured_cores_;
  for (const auto& session : sessions_)
    if (is_alive(*session)) state.sessions.push_back(*session);
  if (const auto written = file_.write(state); !written)
    log::error("{}; a hall that is started now would not find its sessions",
               written.error().message);
}

}  // namespace trocar::hall
