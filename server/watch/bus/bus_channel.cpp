#include "server/watch/bus/bus_channel.h"

#include <boost/asio/post.hpp>
#include <chrono>
#include <optional>

namespace trocar::bus {
namespace {

constexpr std::chrono::seconds kEndTime{1};

}  // namespace

BusChannel::BusChannel(asio::any_io_executor executor, std::unique_ptr<Bus> bus)
    : executor_(std::move(executor)),
      bus_(std::move(bus)),
      sender_([this](const std::stop_token& stop) { send_all(stop); }) {}

BusChannel::~BusChannel() = default;

Status BusChannel::listen(const std::string& subject, Take take) {
  takes_.push_back(std::make_shared<Take>(std::move(take)));
  const std::weak_ptr<Take> kept = takes_.back();
  return bus_->subscribe(subject, [executor = executor_, waiting = waiting_in_, kept, subject](
                                      const std::string& text, const std::string& answer_to) {
    const auto size = cost(subject, text.size(), answer_to);
    if (waiting->fetch_add(size) + size > kMostWaitingBytes) {
      *waiting -= size;
      return;
    }
    asio::post(executor, [waiting, kept, text, answer_to, size] {
      *waiting -= size;
      const auto still = kept.lock();
      if (still) (*still)(bytes_of(std::string_view(text)), answer_to);
    });
  });
}

void BusChannel::send(const std::string& subject, Bytes bytes, const std::string& answer_to) {
  const auto size = cost(subject, bytes.size(), answer_to);
  if (waiting_out_ + size > kMostWaitingBytes) return;
  const std::lock_guard guard(lock_);
  waiting_out_ += size;
  letters_.push_back({subject, {bytes.begin(), bytes.end()}, answer_to});
  has_letter_.notify_one();
}

void BusChannel::send_all(const std::stop_token& stop) {
  std::optional<std::chrono::steady_clock::time_point> end;
  while (true) {
    std::unique_lock guard(lock_);
    if (!has_letter_.wait(guard, stop, [this] { return !letters_.empty(); })) return;
    const auto letter = std::move(letters_.front());
    letters_.pop_front();
    guard.unlock();
    if (stop.stop_requested()) {
      const auto now = std::chrono::steady_clock::now();
      if (!end) end = now + kEndTime;
      if (now > *end) return;
    }
    bus_->publish(letter.subject, letter.text, letter.answer_to);
    waiting_out_ -= cost(letter.subject, letter.text.size(), letter.answer_to);
  }
}

}  // namespace trocar::bus
