// Readings of hands that feel, and the answers to them, on the Asio thread.

#include "client/net/net_session.h"

#include <sched.h>

#include <utility>

#include "client/replica/client_messages.h"
#include "common/base/timing.h"

namespace trocar::net {
namespace {

constexpr std::chrono::milliseconds kHandsPeriod{4};
constexpr int kPriority = 30;  // of 99; that of a hand's loop is higher

}  // namespace

// A picture that is drawn by the processors takes all of them, for longer than a reading may wait.
// Who may not have the priority goes on without; the hand's loop says so.
void NetSource::Session::take_priority() {
  sched_param parameters{};
  parameters.sched_priority = kPriority;
  static_cast<void>(::sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &parameters));
}

void NetSource::Session::pass_on_to_hands(const proto::Envelope& message) {
  if (options_.hands == nullptr) return;
  hand_messages_refused_ += replica::pass_on(message, *options_.hands);
}

asio::awaitable<void> NetSource::Session::serve_hands() {
  auto next = Clock::now();
  while (is_talking() && !is_closing_) {
    next = std::max(next + kHandsPeriod, Clock::now());
    hands_timer_.expires_at(next);
    co_await hands_timer_.async_wait(kNoThrow);
    if (!is_talking() || !has_heard_ || is_closing_) continue;
    take_readings();
    take_reports();
  }
}

// A reading that the stream has not taken yet gives way to the next of its tool.
void NetSource::Session::take_readings() {
  const auto now = monotonic_ns();
  while (const auto reading = options_.hands->pop_reading(now)) {
    if (reading->tool >= readings_.size()) continue;
    proto::Envelope envelope;
    replica::write_reading(*reading, ++reading_sequence_, envelope);
    if (datagrams_ && datagrams_->carry(envelope)) continue;
    readings_[reading->tool] = wire::encode_envelope(envelope);
    wake_timer_.cancel();
  }
  if (datagrams_) datagram_bytes_sent_ = datagrams_->bytes_sent();
}

// Takes what waits for the stream.
void NetSource::Session::take_from_hands() {
  for (auto& reading : readings_)
    if (reading) in_flight_.push_back(std::exchange(reading, nullptr));
  in_flight_.insert(in_flight_.end(), reports_.begin(), reports_.end());
  reports_.clear();
}

void NetSource::Session::take_reports() {
  while (const auto report = options_.hands->pop_report()) {
    if (reports_.size() == kMostReports) {
      sends_dropped_.fetch_add(1, std::memory_order_relaxed);
      continue;
    }
    proto::Envelope envelope;
    replica::write_report(*report, envelope);
    reports_.push_back(wire::encode_envelope(envelope));
    wake_timer_.cancel();
  }
}

}  // namespace trocar::net
