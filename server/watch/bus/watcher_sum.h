#pragma once

// How many watch a session in all: at this relay, and at those that take it from the bus and say so
// now and then. Times are monotonic. Thread: one.

#include <cstdint>
#include <map>
#include <optional>
#include <string>

namespace trocar::bus {

class WatcherSum {
 public:
  static constexpr std::size_t kMostTakers = 256;  // of those who say how many watch there

  void note_own(std::uint32_t watchers) { own_ = watchers; }
  // `taker`: the subject for answers to it.
  void note_taker(const std::string& taker, std::uint32_t watchers, std::uint64_t now_ns);
  // The server has forgotten what it was told.
  void begin_anew() { reported_.reset(); }
  // Returns the sum where it is to be told; nothing: it was, or it is too soon.
  std::optional<std::uint32_t> due(std::uint64_t now_ns);

 private:
  struct Taker {
    std::uint32_t watchers = 0;
    std::uint64_t heard_ns = 0;
  };
  std::map<std::string, Taker> takers_;
  std::optional<std::uint32_t> own_, reported_;
  std::uint64_t reported_ns_ = 0;
};

}  // namespace trocar::bus
