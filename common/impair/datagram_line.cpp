#include "common/impair/datagram_line.h"

#include <algorithm>

namespace trocar::impair {
namespace {

constexpr std::chrono::milliseconds kLongestHold{100};

}  // namespace

DatagramLine::DatagramLine(Direction& direction, const Outage& blocked, std::uint64_t seed)
    : direction_(direction), blocked_(blocked), draws_(seed), losses_(direction.impairment) {}

bool DatagramLine::admit(Time now, std::size_t size) {
  if (bytes_ + size + kOverhead <= kMostBytes && direction_.link.has_room(now)) return true;
  direction_.datagrams.dropped.add(size);
  return false;
}

DatagramLine::Queue::iterator DatagramLine::insert(Time departure, Time entered,
                                                   BytesView datagram) {
  bytes_ += datagram.size() + kOverhead;
  return waiting_.emplace(departure, Waiting{entered, {datagram.begin(), datagram.end()}});
}

void DatagramLine::release_held(Time departure) {
  direction_.datagrams.reordered.add(held_->second.bytes.size());
  auto node = waiting_.extract(held_);
  node.key() = departure;
  waiting_.insert(std::move(node));
  held_ = waiting_.end();
}

void DatagramLine::push(Time now, BytesView datagram) {
  const auto& impairment = direction_.impairment;
  auto& totals = direction_.datagrams;
  const std::uint64_t number = count_++;
  const bool is_lost = losses_.next(draws_.draw(number, Purpose::Loss));
  if (blocked_.contains(now)) return totals.blocked.add(datagram.size());
  if (is_lost) return totals.lost.add(datagram.size());
  if (!admit(now, datagram.size())) return;

  const Time extra(static_cast<std::int64_t>(static_cast<double>(impairment.jitter.count()) *
                                             draws_.draw(number, Purpose::Jitter)));
  const Time sent = direction_.link.send(now, datagram.size());
  const Time departure = std::max(last_in_order_, sent + impairment.delay + extra);
  // None is held while another is, so the others are held more often.
  const bool is_held = held_ == waiting_.end() && draws_.draw(number, Purpose::Reorder) <
                                                      impairment.reorder / (1 - impairment.reorder);
  if (is_held) {
    held_ = insert(departure + kLongestHold, now, datagram);
  } else {
    insert(departure, now, datagram);
    last_in_order_ = departure;
    if (held_ != waiting_.end()) release_held(departure);
  }
  if (draws_.draw(number, Purpose::Duplicate) >= impairment.duplicate) return;
  if (!admit(now, datagram.size())) return;
  totals.duplicated.add(datagram.size());
  last_in_order_ =
      std::max(departure, direction_.link.send(now, datagram.size()) + impairment.delay);
  insert(last_in_order_, now, datagram);
}

Bytes DatagramLine::pop(Time now) {
  const auto first = waiting_.begin();
  if (first == held_) held_ = waiting_.end();
  auto taken = std::move(first->second);
  waiting_.erase(first);
  bytes_ -= taken.bytes.size() + kOverhead;
  direction_.datagrams.passed.add(taken.bytes.size());
  direction_.datagrams.delays.add(now - taken.entered);
  return std::move(taken.bytes);
}

}  // namespace trocar::impair
