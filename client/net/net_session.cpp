#include "client/net/net_session.h"

#include <sched.h>

#include <boost/asio/post.hpp>
#include <cmath>

#include "common/base/log.h"
#include "common/base/spawn.h"
#include "common/base/timing.h"

namespace trocar::net {
namespace {

// A busy server reads the Bye late, and never from who has reset the connection by ending.
constexpr std::chrono::milliseconds kCloseDeadline{2000};
constexpr int kPriority = 30;  // of 99; that of a hand's loop is higher

// A picture that is drawn by the processors takes all of them, for longer than a reading of a hand
// may wait. Who may not have the priority goes on without; the hand's loop says so.
void take_priority() {
  sched_param parameters{};
  parameters.sched_priority = kPriority;
  static_cast<void>(::sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &parameters));
}

std::string words_unreachable(const std::string& name, const std::string& why) {
  const bool is_unknown = why == ServerLink::kUnknownName;
  return "no server at " + name + " (" + why + "): " +
         (is_unknown ? "check how it is spelt, or give the address that the server printed"
                     : "start trocar-server, or check address and port");
}

}  // namespace

NetSource::Session::Session(NetSourceOptions options)
    : options_(std::move(options)),
      link_(context_, options_),
      inbound_(options_.inbound_capacity, options_.inbound_bytes),
      outbound_(options_.outbound_capacity),
      conversation_({context_, options_, link_, comeback_, inbound_, outbound_, figures_},
                    events()) {
  spawn(context_.get_executor(), run(), [this](std::exception_ptr failure) {
    end_if_failed(failure);
    has_ended_.store(true, std::memory_order_release);
  });
  thread_ = std::thread([this] {
    if (options_.hands != nullptr) take_priority();
    context_.run();
  });
}

NetSource::Session::~Session() {
  thread_.join();
}

ConversationEvents NetSource::Session::events() {
  return {.welcome = [this](const proto::Welcome& welcome) { note_welcome(welcome); },
          .broken = [this](std::string why) { break_connection(std::move(why)); },
          .over = [this](auto kind, std::string text) { end(kind, std::move(text)); },
          .failed = [this](const std::exception_ptr& failure) { end_if_failed(failure); }};
}

// ---- render thread ----

bool NetSource::Session::try_send(const proto::Envelope& message) {
  if (message.ByteSizeLong() + wire::kHeaderBytes > wire::kMaxUpstreamBytes ||
      !outbound_.try_push(std::make_shared<proto::Envelope>(message))) {
    ++figures_.sends_dropped;
    return false;
  }
  if (!is_wake_posted_.exchange(true))
    asio::post(context_, [this] {
      is_wake_posted_.exchange(false);  // acquires what was pushed before
      conversation_.wake();
    });
  return true;
}

void NetSource::Session::request_close(const std::string& reason) {
  asio::post(context_, [this, reason] { begin_close(reason); });
}

// ---- Asio thread ----

void NetSource::Session::end(replica::CloseKind kind, std::string text) {
  if (is_done_) return;
  is_done_ = true;
  close_reason_ = {kind, std::move(text)};
  link_.end();
  stop_io();
}

void NetSource::Session::stop_io() {
  link_.cut();
  conversation_.cut();
  retry_timer_.cancel();
  deadline_timer_.cancel();
}

void NetSource::Session::begin_close(const std::string& reason) {
  if (is_done_ || conversation_.is_closing()) return;
  if (!conversation_.is_on()) return end(replica::CloseKind::Ended, "closed: " + reason);
  conversation_.say_bye(reason);
  begin_expiring(Clock::now() + kCloseDeadline);
}

void NetSource::Session::begin_expiring(Clock::time_point deadline) {
  spawn(context_.get_executor(), expire(deadline),
        [this](std::exception_ptr failure) { end_if_failed(failure); });
}

asio::awaitable<void> NetSource::Session::expire(Clock::time_point deadline) {
  deadline_timer_.expires_at(deadline);
  const auto [error] = co_await deadline_timer_.async_wait(kNoThrow);
  const bool is_closing = conversation_.is_closing();
  const bool is_in_time = conversation_.is_on() && !is_closing;
  if (error || is_done_ || is_in_time) co_return;
  if (is_closing) {
    end(replica::CloseKind::Ended, "closed");
  } else {
    stop_io();  // connecting took too long: the pending operation fails and says so
  }
}

// Coroutines here hold no temporaries across a co_await and leave the text to plain functions:
// GCC 12 miscompiles some of them otherwise (seen as a trap on resuming).
asio::awaitable<void> NetSource::Session::run() {
  bool has_connected = co_await connect();
  while (has_connected) {
    why_broken_.clear();
    conversation_.begin();
    co_await conversation_.read();
    break_connection("it was closed");
    const bool is_away = may_come_back();
    if (!is_away && !may_try_again()) {
      if (conversation_.is_closing()) end(replica::CloseKind::Ended, "closed");
      end(replica::CloseKind::Lost,
          "connection to " + server_name() + " broke: the server is gone");
      co_return;
    }
    co_await conversation_.await_end();
    if (is_away)
      has_connected = co_await come_back();
    else
      has_connected = co_await connect();
  }
}

// An exception is a fault of this program: the session ends, and its reason says so.
void NetSource::Session::end_if_failed(const std::exception_ptr& failure) {
  if (!failure) return;
  std::string what = "unknown";
  try {
    std::rethrow_exception(failure);
  } catch (const std::exception& exception) {
    what = exception.what();
  } catch (...) {  // then nothing more is known
  }
  end(replica::CloseKind::Lost, "this client failed (" + what + "): start it again");
}

// A text that says why stands already if this program has broken it.
void NetSource::Session::break_connection(std::string why) {
  if (!conversation_.is_on() || is_done_) return;
  if (why_broken_.empty()) why_broken_ = std::move(why);
  link_.cut();
  if (!may_come_back() && !may_try_again()) return;
  conversation_.cut();
  link_.set_why("it closed the connection before it answered");
  if (!may_come_back()) return;
  if (comeback_.is_away())  // no Welcome came: another address may have one
    link_.turn_to_next_address();
  else
    log::warn("the connection to {} broke ({}): trying again", server_name(), why_broken_);
  comeback_.begin(monotonic_ns());
}

bool NetSource::Session::may_try_again() const {
  return link_.has_tls() && !conversation_.has_heard() && !conversation_.is_closing() &&
         !is_done_ && Clock::now() < connect_until_;
}

bool NetSource::Session::may_come_back() const {
  return comeback_.is_allowed() && !conversation_.is_closing() && !is_done_;
}

asio::awaitable<bool> NetSource::Session::connect() {
  const bool is_first = connect_until_ == Clock::time_point{};
  if (is_first) connect_until_ = Clock::now() + options_.connect_deadline;
  const auto deadline = connect_until_;
  begin_expiring(deadline);
  if (is_first) link_.set_why("no answer");
  bool is_said = false;
  while (!is_done_ && Clock::now() < deadline) {
    if (!is_first || is_said) {
      // Those who were turned away together do not come again together.
      std::uniform_int_distribution<std::int64_t> share(1, 4);
      retry_timer_.expires_after(options_.connect_retry * share(random_));
      co_await retry_timer_.async_wait(kNoThrow);
      if (is_done_) break;
    }
    const bool is_ready = co_await try_to_connect(deadline);
    if (is_ready) co_return true;
    if (is_done_ || Clock::now() >= deadline) break;
    if (!is_said)
      log::info("no server at {} yet ({}): trying for {} s", server_name(), link_.why(),
                std::chrono::ceil<std::chrono::seconds>(options_.connect_deadline).count());
    is_said = true;
  }
  end(replica::CloseKind::Unreachable, words_unreachable(server_name(), link_.why()));
  co_return false;
}

asio::awaitable<bool> NetSource::Session::try_to_connect(Clock::time_point deadline) {
  const bool comes_back = comeback_.is_away();
  const auto outcome = co_await link_.open(deadline, comes_back);
  if (is_done_) co_return false;
  if (outcome == ServerLink::Outcome::Refused) end(replica::CloseKind::Refused, link_.why());
  if (outcome != ServerLink::Outcome::Open) co_return false;
  deadline_timer_.cancel();
  co_return true;
}

asio::awaitable<bool> NetSource::Session::come_back() {
  link_.set_why("no answer");
  while (!is_done_ && !comeback_.is_over(monotonic_ns())) {
    retry_timer_.expires_after(comeback_.next_pause(monotonic_ns()));
    co_await retry_timer_.async_wait(kNoThrow);
    if (is_done_) break;
    const auto deadline = Clock::now() + options_.return_try;
    begin_expiring(deadline);
    const bool is_ready = co_await try_to_connect(deadline);
    if (is_ready) co_return true;
    link_.turn_to_next_address();
  }
  const auto seconds = std::lround(comeback_.figures(monotonic_ns()).away_seconds);
  end(replica::CloseKind::Lost, "connection to " + server_name() +
                                    " broke, and could not be made again for " +
                                    std::to_string(seconds) + " s (" + link_.why() +
                                    "): the server is gone, or check the network");
  co_return false;
}

void NetSource::Session::note_welcome(const proto::Welcome& welcome) {
  const auto now = monotonic_ns();
  if (comeback_.is_away()) {
    log::info("back in the session at {} after {:.1f} s", server_name(),
              comeback_.figures(now).away_seconds);
    comeback_.end(now);
  }
  if (options_.can_return) comeback_.allow(welcome.return_token(), welcome.return_seconds());
  // Without a certificate to compare, a server could send its clients anywhere.
  if (options_.join_code)
    for (const auto& address : welcome.further_address()) link_.note_address(address);
}

}  // namespace trocar::net
