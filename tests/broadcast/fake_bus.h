#pragma once

// A bus in memory, an upstream that says what a test wants, and a relay's place behind a tap.

#include <algorithm>
#include <deque>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "proto/wire.pb.h"
#include "server/watch/bus/channel.h"
#include "server/watch/follow/session_copy.h"
#include "server/watch/follow/upstream.h"

namespace trocar::bus {

struct FakeBus {
  struct Letter {
    const void* sender;
    std::string subject;
    Bytes bytes;
    std::string answer_to;
  };
  struct Listener {
    const void* owner;
    std::string subject;
    Channel::Take take;
  };
  std::deque<Letter> letters;
  std::vector<Listener> listeners;
  std::set<std::string> lost_subjects;  // nothing of these arrives
  std::set<std::string> late_subjects;  // what is sent to these arrives when nothing else is left
  std::size_t most_bytes = 1024 * 1024, waiting_bytes = 0;
  std::size_t sent_bytes = 0;

  // Delivers everything, also what is sent meanwhile.
  void deliver() {
    std::deque<Letter> late;
    while (!letters.empty() || !late.empty()) {
      auto& next = letters.empty() ? late : letters;
      auto letter = std::move(next.front());
      next.pop_front();
      if (&next == &letters && late_subjects.contains(letter.subject)) {
        late.push_back(std::move(letter));
        continue;
      }
      if (lost_subjects.contains(letter.subject)) continue;
      for (std::size_t i = 0; i < listeners.size(); ++i)
        if (listeners[i].subject == letter.subject && listeners[i].owner != letter.sender)
          listeners[i].take(letter.bytes, letter.answer_to);
    }
  }
};

class FakeChannel final : public Channel {
 public:
  explicit FakeChannel(FakeBus& bus) : bus_(bus) {}
  ~FakeChannel() override {
    std::erase_if(bus_.listeners, [this](const auto& one) { return one.owner == this; });
  }

  Status listen(const std::string& subject, Take take) override {
    bus_.listeners.push_back({this, subject, std::move(take)});
    return {};
  }
  void send(const std::string& subject, Bytes bytes, const std::string& answer_to) override {
    if (bytes.size() > bus_.most_bytes) return;
    bus_.sent_bytes += bytes.size();
    bus_.letters.push_back({this, subject, std::move(bytes), answer_to});
  }
  std::size_t waiting_bytes() const override { return bus_.waiting_bytes; }
  std::size_t most_bytes() const override { return bus_.most_bytes; }

 private:
  FakeBus& bus_;
};

// A test sets `state` and reads there what was said; it outlives this.
class FakeUpstream final : public follow::Upstream {
 public:
  struct State {
    follow::UpstreamEvents events;
    bool is_welcome = false;
    std::uint64_t ahead_us = 5000;  // the server's clock of ours
    std::vector<proto::Envelope> said;
  };
  explicit FakeUpstream(State& state) : state_(state) {}

  void start(follow::UpstreamEvents events) override { state_.events = std::move(events); }
  void stop() override { state_.events = {}; }
  void say(const proto::Envelope& message) override { state_.said.push_back(message); }
  std::string name() const override { return "fake"; }
  bool is_welcome() const override { return state_.is_welcome; }
  std::uint64_t server_time_us(std::uint64_t now_us) const override {
    return now_us + state_.ahead_us;
  }
  std::uint64_t bytes_received() const override { return 0; }
  std::uint64_t returns() const override { return 0; }

 private:
  State& state_;
};

}  // namespace trocar::bus
