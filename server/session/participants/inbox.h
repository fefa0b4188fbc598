#pragma once

// The way of inputs from the I/O thread into the simulation: a bounded queue without locks.
//
//   I/O thread: try_push_join, push_leave, try_push_change, push_sample --> [1024] --> drain
//
// When full: samples are dropped and counted (the next one of that tool replaces it anyway). Joins
// and leaves have reserved room: a join is taken only if there is also room for everybody present
// to leave, so a leave always fits. drain() gives one tick's inputs in the order a tick admits them
// (handover, leaves, joins, changes, samples): only the newest sample and change of each tool, and
// none that an earlier tenant of a slot left behind. So a new tenant never starts with somebody
// else's pose. A handover begins a tick: what came before it goes to the tick before.

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>
#include <variant>

#include "common/base/spsc_queue.h"
#include "server/tissue/hands/inputs.h"

namespace trocar::participants {

class SimulationInbox {
 public:
  static constexpr std::size_t kCapacity = 1024;
  static constexpr std::size_t kReservedForJoins = 64;

  struct Counters {
    std::uint64_t samples_taken = 0;
    std::uint64_t samples_dropped = 0;  // queue full
  };

  // I/O thread.
  [[nodiscard]] bool try_push_join(const hands::HandJoin& join);  // false: no room, refuse the join
  void push_leave(ParticipantSlot slot);                          // of a slot that has joined
  void note_hand() { ++joined_hands_; }  // that the simulation has from the start
  // Samples before it are of the instrument before. False: no room.
  [[nodiscard]] bool try_push_change(const hands::ToolChange& change);
  // Samples after it are of the hands that the tools have by then. False: no room.
  [[nodiscard]] bool try_push_handover(const hands::Handover& handover);
  void push_sample(const hands::ToolInput& input);
  // If two marks arrive before a drain, the newer one counts.
  void push_mark(hands::MarkAction action, std::uint8_t number = 0) {
    mark_.store({action, number}, std::memory_order_relaxed);
  }
  const Counters& counters() const { return counters_; }

  // Simulation thread. While no tick comes: takes what is queued, so that there is room; the next
  // drain() gives it.
  void gather();
  // Simulation thread. Replaces the content of `inputs`; at most kCapacity items per call.
  void drain(hands::TickInputs& inputs);

 private:
  using Item = std::variant<std::monostate, ParticipantSlot, hands::HandJoin, hands::ToolChange,
                            hands::ToolInput, hands::Handover>;

  void push(Item item);
  // Nothing has been gathered for the next tick.
  bool is_fresh() const;

  SpscQueue<Item> queue_{kCapacity};
  std::atomic<std::size_t> pending_{0};  // never less than what is in queue_
  struct alignas(2) Mark {               // in one lock-free store
    hands::MarkAction action = hands::MarkAction::None;
    std::uint8_t number = 0;
  };
  std::atomic<Mark> mark_{Mark{}};
  std::size_t joined_hands_ = 0;  // I/O thread
  Counters counters_;             // I/O thread

  // Simulation thread: what this drain has seen, by slot.
  struct SlotChange {
    bool leaves = false;
    std::optional<hands::HandJoin> join;
  };
  std::array<SlotChange, kMaxHands> changes_;
  std::array<std::optional<hands::ToolChange>, kMaxTools> tool_changes_;
  std::array<std::optional<hands::ToolInput>, kMaxTools> samples_;
  std::optional<hands::Handover> handover_, next_handover_;  // next: of the tick after
};

}  // namespace trocar::participants
