#include "client/crtk/crtk.h"

#include <algorithm>
#include <chrono>
#include <csignal>
#include <memory>
#include <thread>
#include <vector>

#include "client/crtk/seat.h"
#include "common/base/log.h"
#include "common/base/signals.h"
#include "common/base/timing.h"

namespace trocar::crtk {
namespace {

volatile std::sig_atomic_t stop_requested = 0;

constexpr std::uint64_t kPollNs = 2'000'000;         // frames come every 16 ms
constexpr std::uint64_t kLeastRoundNs = 300'000;     // a flood does not take all of a processor
constexpr std::uint64_t kGoodbyeNs = 2'500'000'000;  // longer than a source waits for that
constexpr std::uint64_t kSameWordsNs = 1'000'000'000;

void sleep_ns(std::uint64_t ns) {
  std::this_thread::sleep_for(std::chrono::nanoseconds(ns));
}

// Says the same thing once a second at most, and ten things a second.
class Words {
 public:
  bool may_say(const std::string& text, std::uint64_t now_ns) {
    std::erase_if(said_, [&](const Said& one) { return now_ns - one.ns >= kSameWordsNs; });
    if (said_.size() >= kMostWords) return false;
    if (std::ranges::find(said_, text, &Said::text) != said_.end()) return false;
    said_.push_back({text, now_ns});
    return true;
  }

 private:
  struct Said {
    std::string text;
    std::uint64_t ns = 0;
  };
  static constexpr std::size_t kMostWords = 10;

  std::vector<Said> said_;
};

struct Place {
  Place(const ArmOptions& options, net::NetSourceOptions way)
      : arm(options.settings), seat(std::move(way)) {}

  Arm arm;
  Seat seat;
  Words words;
  std::optional<OperatingState> given;
};

class Robot {
 public:
  Robot(const CrtkOptions& options, const net::NetSourceOptions& way, std::unique_ptr<Bus> bus)
      : bus_(std::move(bus)) {
    for (const auto& arm : options.arms) {
      auto own = way;
      own.participant_name = arm.settings.name;
      own.tools = {arm.shape};
      places_.push_back(std::make_unique<Place>(arm, std::move(own)));
    }
  }

  // One round; false: an arm's session is over.
  bool turn() {
    bus_->wait(longest_wait_ns(monotonic_ns()));
    const auto woken_ns = monotonic_ns();
    if (woken_ns - turned_ns_ < kLeastRoundNs) sleep_ns(kLeastRoundNs - (woken_ns - turned_ns_));
    turned_ns_ = monotonic_ns();
    // First what may not wait.
    for (std::size_t i = 0; i < places_.size(); ++i) obey(i, turned_ns_);
    for (std::size_t i = 0; i < places_.size(); ++i) show(i, monotonic_ns());
    return std::ranges::none_of(places_, [](const auto& p) { return p->seat.is_closed(); });
  }

  // Why it is over, and whose arm's session it was.
  replica::CloseReason closed() const {
    for (const auto& place : places_)
      if (place->seat.is_closed()) {
        auto reason = place->seat.closed();
        reason.text = place->arm.settings().name + ": " + reason.text;
        return reason;
      }
    return {};
  }

  void leave(const std::string& why) {
    for (auto& place : places_) place->seat.leave(why);
    const auto until = monotonic_ns() + kGoodbyeNs;
    const auto is_gone = [](const auto& p) { return p->seat.is_closed(); };
    while (!std::ranges::all_of(places_, is_gone) && monotonic_ns() < until) {
      for (auto& place : places_) place->seat.poll();
      sleep_ns(kPollNs);
    }
  }

 private:
  std::uint64_t longest_wait_ns(std::uint64_t now_ns) const {
    std::uint64_t wait_ns = kPollNs;
    for (const auto& place : places_)
      if (const auto pause_ns = place->seat.pause_ns(now_ns); pause_ns > 0)
        wait_ns = std::min(wait_ns, pause_ns);
    return wait_ns;
  }

  void obey(std::size_t i, std::uint64_t now_ns) {
    auto& [arm, seat, words, given] = *places_[i];
    const auto heed = [&](const Status& followed) {
      if (!followed) warn(i, followed.error().message, now_ns);
    };
    for (const auto& command : bus_->take_commands(i)) heed(arm.follow(command));
    if (const auto servo = bus_->take_pose(i)) heed(arm.take(*servo, now_ns));
    if (const auto servo = bus_->take_wrench(i)) heed(arm.take(*servo, now_ns));
    if (const auto servo = bus_->take_jaw(i)) heed(arm.take(*servo));
    arm.step(now_ns);
    const auto sample = arm.sample();
    if (seat.is_due(sample, now_ns)) seat.send(sample, now_ns);
  }

  void show(std::size_t i, std::uint64_t now_ns) {
    auto& [arm, seat, words, given] = *places_[i];
    seat.poll();
    arm.set_fault(seat.fault());
    arm.set_hold(seat.hold());
    if (const auto seen = seat.see_tool()) bus_->give(i, arm.measure(seen->tool, seen->tick));
    while (const auto told = seat.pop_told()) warn(i, *told, now_ns);
    if (const auto notice = arm.pop_notice()) warn(i, *notice, now_ns);
    if (given == arm.state()) return;
    given = arm.state();
    bus_->give(i, arm.state());
    log::info("{}: {}{}{}", arm.settings().name, name_of(given->state),
              given->is_homed ? ", homed" : "", given->is_busy ? ", busy" : "");
  }

  void warn(std::size_t i, const std::string& text, std::uint64_t now_ns) {
    auto& place = *places_[i];
    if (!place.words.may_say(text, now_ns)) return;
    const bool is_fault = place.arm.state().state == State::Fault;
    if (is_fault)
      bus_->tell_error(i, text);
    else
      bus_->warn(i, text);
    log::warn("{}: {}", place.arm.settings().name, text);
  }

  std::unique_ptr<Bus> bus_;
  std::vector<std::unique_ptr<Place>> places_;
  std::uint64_t turned_ns_ = 0;
};

std::vector<BusArm> bus_arms(const std::vector<ArmOptions>& arms) {
  std::vector<BusArm> all;
  for (const auto& [settings, shape] : arms) {
    const auto names = settings.kinematics.joint_names();
    all.push_back(
        {settings.name, settings.frame(), settings.has_jaw, {names.begin(), names.end()}});
  }
  return all;
}

}  // namespace

void install_signal_handlers() {
  for (const int signal : ending_signals())
    std::signal(signal, [](int) {
      stop_requested = 1;
      ignore_ending_signals();
    });
}

Result<ExitCode> run_crtk(const CrtkOptions& options) {
  net::NetSourceOptions way;
  if (const auto parsed = net::parse_server_address(options.server, way); !parsed)
    return Error{parsed.error().code, "--server: " + parsed.error().message};
  if (const auto set = net::set_security(options.way_in, way); !set) return set.error();
  way.role = static_cast<int>(options.way_in.role);
  way.connect_deadline = std::chrono::milliseconds(static_cast<std::int64_t>(options.wait_s * 1e3));
  auto bus = Bus::open(options.bus, bus_arms(options.arms));
  if (!bus) return bus.error();
  Robot robot(options, way, std::move(*bus));
  const auto begin_ns = monotonic_ns();
  const auto is_late = [&] {
    return options.seconds > 0 &&
           static_cast<double>(monotonic_ns() - begin_ns) * 1e-9 >= options.seconds;
  };
  while (stop_requested == 0 && !is_late())
    if (!robot.turn()) {
      const auto reason = robot.closed();
      robot.leave("the session of " + reason.text);
      if (const auto ending = net::ending_of(reason); !ending) return ending.error();
      log::info("the session is over: {}", reason.text);
      return ExitCode::Ok;
    }
  robot.leave(stop_requested != 0 ? "stopped by a signal" : "end of --seconds");
  return ExitCode::Ok;
}

}  // namespace trocar::crtk
