#pragma once

// Who may come back to a place in the session after a connection broke.
//
//   issue --> begin (the connection is lost) --> end (came back)
//                                            \-> is among expired(): the place is to be given up
//
// A token is 16 random bytes, the same for as long as its owner has the place. Tokens are kept here
// only; nobody writes them anywhere. Thread: the I/O thread.

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/ids.h"

namespace trocar::participants {

inline constexpr std::size_t kReturnTokenBytes = 16;
using ReturnToken = std::array<std::uint8_t, kReturnTokenBytes>;

class Absences {
 public:
  // kept_seconds: for so long a place is kept; 0: nobody can come back.
  explicit Absences(std::uint32_t kept_seconds) : kept_seconds_(kept_seconds) {}

  // Makes the token of who has just got this place; null where places are not kept.
  const ReturnToken* issue(ParticipantSlot slot);
  const ReturnToken* find(ParticipantSlot slot) const;
  // Gives a place the token that it had at a server before; false where places are not kept.
  bool restore(ParticipantSlot slot, const ReturnToken& token);
  // Takes as long for a wrong token as for the right one.
  bool is_token_of(ParticipantSlot slot, BytesView token) const;

  // Whoever has this place is away from now on; false: there is no token to come back with.
  bool begin(ParticipantSlot slot, std::uint64_t now_ns);
  void end(ParticipantSlot slot);
  // The place is free.
  void forget(ParticipantSlot slot);
  // Those who have been away for too long.
  std::vector<ParticipantSlot> expired(std::uint64_t now_ns) const;

  std::uint32_t kept_seconds() const { return kept_seconds_; }

 private:
  struct Place {
    ReturnToken token{};
    std::optional<std::uint64_t> away_since_ns;
  };

  std::uint32_t kept_seconds_;
  std::array<std::optional<Place>, kMaxParticipants> places_;
};

}  // namespace trocar::participants
