#include "common/intake/acceptor.h"

#include <algorithm>
#include <boost/asio/steady_timer.hpp>
#include <map>
#include <utility>
#include <vector>

#include "common/base/no_throw.h"
#include "common/base/spawn.h"
#include "common/intake/room.h"

namespace trocar::intake {
namespace {

using tcp = asio::ip::tcp;
using Clock = std::chrono::steady_clock;

// After a failed accept (no file descriptors left): wait instead of spinning.
constexpr std::chrono::milliseconds kAcceptRetry{100};
constexpr std::chrono::milliseconds kSweepPeriod{100};

}  // namespace

Status check_address(const std::string& address, const std::string& named) {
  boost::system::error_code error;
  asio::ip::make_address(address, error);
  if (!error) return {};
  return Error{ErrorCode::Usage, named + ": '" + address +
                                     "' is not an IPv4 or IPv6 address: use 127.0.0.1 for this "
                                     "machine only, 0.0.0.0 for any"};
}

struct Acceptor::State : std::enable_shared_from_this<Acceptor::State> {
  const Limits limits;
  tcp::acceptor acceptor;
  asio::steady_timer retry, sweep;
  Room all, silent;
  std::map<std::uint64_t, Peer*> peers;         // by their numbers
  std::map<std::uint64_t, Peer*> silent_peers;  // the oldest first
  std::uint64_t next_id = 1;
  bool is_sweeping = false;
  Counters counters;

  State(asio::io_context& context, const Limits& given)
      : limits(given),
        acceptor(context),
        retry(context),
        sweep(context),
        all(given.most, given.most_per_address),
        silent(given.most_silent, given.most_silent_per_address) {}

  // One who has only just come cannot be cut yet.
  void cut(Peer& peer, Cut why) {
    const auto end = peer.cut_;
    if (!end) return;
    peer.speak();  // nobody is cut twice
    end(why);
  }

  // False: nobody can be cut.
  bool make_room(const std::string& address, Room::Place lack) {
    std::map<std::string, int> counts;
    for (const auto& [since, peer] : silent_peers) ++counts[counted_as(peer->address_)];
    int most = 0;
    for (const auto& [of, count] : counts) most = std::max(most, count);
    const auto oldest = std::ranges::find_if(silent_peers, [&](const auto& one) {
      const auto of = counted_as(one.second->address_);
      const bool is_of_those =
          lack == Room::Place::AddressFull ? of == counted_as(address) : counts[of] == most;
      return one.second->cut_ && is_of_those;
    });
    if (oldest == silent_peers.end()) return false;
    ++counters.cut;
    cut(*oldest->second, Cut::NoRoom);
    return true;
  }

  bool admit(const std::string& address) {
    for (const auto* room : {&silent, &all}) {
      const auto place = room->place_for(address);
      if (place == Room::Place::Free) continue;
      if (make_room(address, place)) break;
      ++counters.refused;
      return false;
    }
    ++counters.accepted;
    return true;
  }

  static asio::awaitable<void> accept(std::shared_ptr<State> self, Serve serve) {
    auto& acceptor = self->acceptor;
    while (acceptor.is_open()) {
      auto [error, socket] = co_await acceptor.async_accept(kNoThrow);
      if (!acceptor.is_open()) co_return;
      if (error) {
        self->retry.expires_after(kAcceptRetry);
        co_await self->retry.async_wait(kNoThrow);
        continue;
      }
      boost::system::error_code ignored;
      const auto address = socket.remote_endpoint(ignored).address().to_string();
      if (!self->admit(address)) continue;  // closes it
      socket.set_option(tcp::no_delay(true), ignored);
      auto peer = std::make_unique<Peer>(self, address);
      spawn(acceptor.get_executor(), serve(std::move(socket), std::move(peer)),
            [serve](const std::exception_ptr& failure) { rethrow(failure); });
    }
  }

  // While there is somebody silent.
  void sweep_late() {
    if (std::exchange(is_sweeping, true)) return;
    sweep.expires_after(kSweepPeriod);
    sweep.async_wait([held = weak_from_this()](boost::system::error_code error) {
      const auto self = held.lock();
      if (error || !self) return;
      self->is_sweeping = false;
      self->cut_late();
      if (!self->silent_peers.empty()) self->sweep_late();
    });
  }

  void cut_late() {
    const auto now = Clock::now();
    cut_those(silent_peers, Cut::Late, [now](const Peer& peer) { return peer.deadline_ <= now; });
  }

  // One who is cut may take others with it.
  template <typename Which>
  void cut_those(const std::map<std::uint64_t, Peer*>& of, Cut why, Which which) {
    std::vector<std::uint64_t> numbers;
    for (const auto& [number, peer] : of)
      if (which(*peer)) numbers.push_back(number);
    for (const auto number : numbers)
      if (const auto found = of.find(number); found != of.end()) cut(*found->second, why);
  }
};

Acceptor::Peer::Peer(std::shared_ptr<State> state, std::string address)
    : state_(std::move(state)), address_(std::move(address)), id_(state_->next_id++) {
  state_->peers.emplace(id_, this);
  state_->all.enter(address_);
  fall_silent();
}

Acceptor::Peer::~Peer() {
  speak();
  state_->all.leave(address_);
  state_->peers.erase(id_);
}

void Acceptor::Peer::fall_silent() {
  speak();
  deadline_ = Clock::now() + state_->limits.time_to_speak;
  state_->silent.enter(address_);
  silent_since_ = state_->next_id++;
  state_->silent_peers.emplace(silent_since_, this);
  state_->sweep_late();
}

void Acceptor::Peer::show_life() {
  auto node = state_->silent_peers.extract(silent_since_);
  if (node.empty()) return;
  node.key() = silent_since_ = state_->next_id++;
  state_->silent_peers.insert(std::move(node));
}

void Acceptor::Peer::speak() {
  if (state_->silent_peers.erase(std::exchange(silent_since_, 0)) > 0)
    state_->silent.leave(address_);
}

Acceptor::Acceptor(asio::io_context& context, const Limits& limits)
    : state_(std::make_shared<State>(context, limits)) {}

Status Acceptor::open(const std::string& address, std::uint16_t port, const std::string& named) {
  if (auto checked = check_address(address, named); !checked) return checked;
  auto& acceptor = state_->acceptor;
  boost::system::error_code error;
  const tcp::endpoint endpoint(asio::ip::make_address(address, error), port);
  acceptor.open(endpoint.protocol(), error);
  if (!error) acceptor.set_option(tcp::acceptor::reuse_address(true), error);
  if (!error) acceptor.bind(endpoint, error);
  if (!error) acceptor.listen(asio::socket_base::max_listen_connections, error);
  if (!error) return {};
  return Error{ErrorCode::ResourceMissing, named + ": " + address + ":" + std::to_string(port) +
                                               ": " + error.message() +
                                               ", stop the program that has it or choose another "
                                               "port"};
}

void Acceptor::start(Serve serve) {
  spawn(state_->acceptor.get_executor(), State::accept(state_, std::move(serve)), rethrow);
}

void Acceptor::stop() {
  boost::system::error_code ignored;
  state_->acceptor.close(ignored);
  state_->retry.cancel();
}

void Acceptor::cut_all() {
  state_->cut_those(state_->peers, Cut::End, [](const Peer&) { return true; });
}

std::uint16_t Acceptor::port() const {
  boost::system::error_code ignored;
  return state_->acceptor.local_endpoint(ignored).port();
}

bool Acceptor::is_stopping() const {
  return !state_->acceptor.is_open();
}

int Acceptor::count() const {
  return state_->all.count();
}

const Counters& Acceptor::counters() const {
  return state_->counters;
}

}  // namespace trocar::intake
