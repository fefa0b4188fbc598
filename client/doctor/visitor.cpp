#include "client/doctor/visitor.h"

#include "common/base/asio.h"  // before Boost: see there

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <chrono>
#include <thread>
#include <vector>

#include "client/net/net_source.h"
#include "client/replica/time_distribution.h"
#include "common/base/timing.h"
#include "common/secure/join_code.h"
#include "common/secure/link_file.h"
#include "common/secure/loopback.h"

namespace trocar::doctor {
namespace {

using asio::ip::tcp;
using std::chrono::milliseconds;

constexpr double kWarmUpSeconds = 1;  // in which clocks and paths are found
constexpr milliseconds kPoll{4};
constexpr milliseconds kPing{100};
constexpr std::uint64_t kGoodbyeNs = 2'500'000'000;  // longer than its source waits

double seconds_between(std::uint64_t begin_ns, std::uint64_t end_ns) {
  return static_cast<double>(end_ns - begin_ns) * 1e-9;
}

milliseconds milliseconds_of(double seconds) {
  return milliseconds(static_cast<std::int64_t>(seconds * 1e3));
}

// Looks the name up and opens a connection that it closes again.
void find_way(const net::NetSourceOptions& to, double wait_s, Visit& visit) {
  asio::io_context context;
  tcp::resolver resolver(context);
  boost::system::error_code error;
  const auto found = resolver.resolve(to.host, std::to_string(to.port), error);
  if (error || found.empty()) {
    visit.problem = fmt::format("{}: no address has this name ({}).", to.host, error.message());
    return;
  }
  visit.address = found.begin()->endpoint().address().to_string();
  tcp::socket socket(context);
  bool is_done = false;
  const auto begin = monotonic_ns();
  const auto until = begin + static_cast<std::uint64_t>(wait_s * 1e9);
  while (!is_done) {
    boost::system::error_code outcome = asio::error::timed_out;
    socket = tcp::socket(context);
    const auto try_ns = monotonic_ns();
    socket.async_connect(found.begin()->endpoint(),
                         [&outcome](const boost::system::error_code& e) { outcome = e; });
    context.restart();
    context.run_for(
        milliseconds_of(std::max(0.0, seconds_between(try_ns, std::max(until, try_ns)))));
    visit.connect_ms = seconds_between(try_ns, monotonic_ns()) * 1e3;
    visit.is_reached = !outcome;
    is_done = !outcome || monotonic_ns() >= until;
    // The last try may have had no time: what was said before tells more.
    if (outcome && (visit.problem.empty() || outcome != asio::error::timed_out))
      visit.problem = fmt::format("{} ({}) port {} does not answer: {}.", to.host, visit.address,
                                  to.port, outcome.message());
    boost::system::error_code ignored;
    socket.close(ignored);
    context.restart();
    context.poll();  // what was cancelled ends before `outcome` does
    if (!is_done) std::this_thread::sleep_for(to.connect_retry);
  }
  if (visit.is_reached) visit.problem.clear();
}

// Sets how the server is known, and the code. Returns false if a code is needed and there is none.
Result<bool> set_security(const VisitOptions& options, net::NetSourceOptions& to) {
  const bool is_loopback = secure::is_loopback(to.host) || to.host == "localhost";
  if (options.is_insecure) {
    if (is_loopback) return true;
    return Error{ErrorCode::Usage, "--insecure-loopback: " + to.host +
                                       " is no address of this machine: use it with 127.0.0.1"};
  }
  if (options.ca_file.empty()) {
    to.tls = secure::make_client_context();
  } else {
    auto tls = secure::make_client_context_with_ca(options.ca_file);
    if (!tls) return Error{ErrorCode::Usage, "--ca: " + tls.error().message};
    to.tls = std::move(*tls);
    to.trusts_ca = true;
  }
  if (!options.join.empty()) {
    const auto invitation = secure::parse_invitation(options.join);
    if (!invitation) return Error{ErrorCode::Usage, "--join: " + invitation.error().message};
    to.join_code = [code = invitation->code]() -> Result<secure::JoinCode> { return code; };
    return true;
  }
  if (!is_loopback) return false;
  to.join_code = [port = to.port] { return secure::read_link_file(port, "observer"); };
  return true;
}

class Stay {
 public:
  Stay(net::NetSourceOptions to, const VisitOptions& options, Visited& visited)
      : options_(options), visited_(visited), visit_(visited.figures), source_(std::move(to)) {
    visited_.replica = std::make_unique<replica::Replica>(
        [this](const proto::Envelope& message) { return source_.send(message); });
  }
  ~Stay() { leave(); }

  void run() {
    begin_ns_ = monotonic_ns();
    while (!is_over(monotonic_ns())) {
      std::this_thread::sleep_for(kPoll);
      source_.poll(replica());
      note(monotonic_ns());
    }
    conclude();
  }

 private:
  replica::Replica& replica() { return *visited_.replica; }

  bool is_over(std::uint64_t now_ns) {
    if (!replica().fault().ok()) {
      visit_.problem = replica().fault().error().message;
      return true;
    }
    if (source_.state() == replica::SourceState::Closed) {
      const auto reason = source_.close_reason();
      visit_.problem = reason.text;
      visit_.is_refused = reason.kind == replica::CloseKind::Refused;
      return true;
    }
    if (live_ns_ == 0) {
      if (seconds_between(begin_ns_, now_ns) < options_.wait_s) return false;
      visit_.problem =
          fmt::format("{}: no picture came within {:.0f} s.", visit_.server, options_.wait_s);
      return true;
    }
    return seconds_between(live_ns_, now_ns) >= kWarmUpSeconds + options_.seconds;
  }

  std::uint64_t bytes() const {
    const auto statistics = source_.statistics();
    return statistics.bytes_received + statistics.datagram_bytes_received;
  }

  void note(std::uint64_t now_ns) {
    if (replica().newest() == nullptr) return;
    if (live_ns_ == 0) {
      live_ns_ = now_ns;
      visit_.is_joined = true;
      visit_.organ = replica().topology().organ_name;
      visit_.join_seconds = seconds_between(begin_ns_, now_ns);
      visit_.join_bytes = static_cast<double>(bytes());
    }
    visited_.surface.update(replica(), now_ns);
    if (seconds_between(live_ns_, now_ns) < kWarmUpSeconds) return;
    const auto statistics = source_.statistics();
    if (from_ns_ == 0) {
      from_ns_ = now_ns;
      from_ = statistics;
      from_bytes_ = bytes();
      from_frames_ = replica().counters().frames;
      from_tick_ = replica().newest()->tick;
    }
    to_ns_ = now_ns;
    if (statistics.round_trip_seconds != last_round_trip_) {
      last_round_trip_ = statistics.round_trip_seconds;
      round_trips_ms_.push_back(last_round_trip_ * 1e3);
    }
    if (!statistics.has_server_clock) return;
    const double server_now_us = static_cast<double>(now_ns) * 1e-3 + statistics.server_offset_us;
    if (const auto age = replica().age_ms(server_now_us)) age_.add(*age);
  }

  void conclude() {
    if (!visit_.is_joined || from_ns_ == 0) return;
    visit_.seconds = seconds_between(from_ns_, to_ns_);
    if (visit_.seconds <= 0) return;
    const auto statistics = source_.statistics();
    std::ranges::sort(round_trips_ms_);
    const auto share = [&](double part) {
      if (round_trips_ms_.empty()) return 0.0;
      const auto last = static_cast<double>(round_trips_ms_.size() - 1);
      return round_trips_ms_[static_cast<std::size_t>(part * last + 0.5)];
    };
    visit_.round_trip_ms = share(0.5);
    visit_.round_trip_95_ms = share(0.95);
    const auto received = statistics.datagrams_received - from_.datagrams_received;
    const auto lost = statistics.datagrams_lost > from_.datagrams_lost
                          ? statistics.datagrams_lost - from_.datagrams_lost
                          : 0;
    visit_.has_datagrams = received > 0;
    if (received > 0)
      visit_.lost_share = static_cast<double>(lost) / static_cast<double>(received + lost);
    const auto frames = static_cast<double>(replica().counters().frames - from_frames_);
    const auto came = static_cast<double>(bytes() - from_bytes_);
    const auto* newest = replica().newest();
    const double ticks = newest != nullptr && newest->tick > from_tick_
                             ? static_cast<double>(newest->tick - from_tick_)
                             : 0;
    visit_.bytes_per_second = came / visit_.seconds;
    visit_.frame_bytes = frames > 0 ? came / frames : 0;
    visit_.frames_per_second = frames / visit_.seconds;
    const double made = ticks / static_cast<double>(kTicksPerFrame);
    visit_.frames_share = made >= 1 ? std::min(1.0, frames / made) : 1;
    visit_.session_speed = ticks * kTickSeconds / visit_.seconds;
    visit_.frame_age_ms = age_.quantile_ms(0.05);
    visit_.shown_later_ms = visited_.surface.delay_ticks() * kTickSeconds * 1e3;
    visit_.has_clock = statistics.has_server_clock;
    visit_.clock_offset_ms = statistics.server_offset_us * 1e-3;
    visit_.clock_error_ms = statistics.shortest_round_trip_seconds * 1e3 / 2;
  }

  void leave() {
    source_.close("the check is over");
    const auto until = monotonic_ns() + kGoodbyeNs;
    while (source_.state() != replica::SourceState::Closed && monotonic_ns() < until) {
      source_.poll(replica());
      std::this_thread::sleep_for(kPoll);
    }
  }

  const VisitOptions& options_;
  Visited& visited_;
  Visit& visit_;
  net::NetSource source_;
  std::uint64_t begin_ns_ = 0, live_ns_ = 0, from_ns_ = 0, to_ns_ = 0;
  replica::SourceStatistics from_;
  std::uint64_t from_bytes_ = 0, from_frames_ = 0;
  Tick from_tick_ = 0;
  double last_round_trip_ = 0;
  std::vector<double> round_trips_ms_;
  replica::TimeDistribution age_;
};

}  // namespace

Result<Visited> visit_session(const VisitOptions& options) {
  Visited visited;
  auto& visit = visited.figures;
  net::NetSourceOptions to;
  if (const auto parsed = net::parse_server_address(options.server, to); !parsed)
    return Error{ErrorCode::Usage, "SERVER: " + parsed.error().message};
  const auto has_code = set_security(options, to);
  if (!has_code) return has_code.error();
  visit.server = to.host + ":" + std::to_string(to.port);
  find_way(to, options.wait_s, visit);
  visit.lacks_code = !*has_code;
  if (!visit.is_reached || visit.lacks_code) return visited;
  to.role = static_cast<int>(replica::Role::Observer);
  to.participant_name = "check-" + std::to_string(::getpid());
  to.connect_deadline = milliseconds_of(options.wait_s);
  to.ping_interval = kPing;
  to.can_return = false;
  Stay(std::move(to), options, visited).run();
  if (!visit.is_joined) visited.replica.reset();
  return visited;
}

}  // namespace trocar::doctor
