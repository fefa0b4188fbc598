#pragma once

// Names of things that outlive a tick. Slots are reused; the generation tells tenants apart.

#include <compare>
#include <cstdint>

namespace trocar {

inline constexpr int kMaxHands = 16;     // participants with tools (surgeons and assistants)
inline constexpr int kToolsPerHand = 2;  // tools of one participant
inline constexpr int kMaxTools = kMaxHands * kToolsPerHand;
inline constexpr int kMaxWatchers = 200;  // instructors and observers
inline constexpr int kMaxParticipants = kMaxHands + kMaxWatchers;

// Participant slot: [0, kMaxHands) have tools, the rest watch.
struct ParticipantSlot {
  std::uint8_t value = 0xff;

  auto operator<=>(const ParticipantSlot&) const = default;
  bool is_valid() const { return value < kMaxParticipants; }
  bool has_tools() const { return value < kMaxHands; }
};

// A tool slot is participant slot x kToolsPerHand + tool number.
struct ToolSlot {
  std::uint8_t value = 0xff;

  auto operator<=>(const ToolSlot&) const = default;
  bool is_valid() const { return value < kMaxTools; }
  ParticipantSlot owner() const {
    return {static_cast<std::uint8_t>(is_valid() ? value / kToolsPerHand : 0xff)};
  }
  int number() const { return value % kToolsPerHand; }
};
inline ToolSlot tool_slot(ParticipantSlot owner, int number) {
  return {static_cast<std::uint8_t>(owner.value * kToolsPerHand + number)};
}

}  // namespace trocar
