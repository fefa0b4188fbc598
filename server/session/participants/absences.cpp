#include "server/session/participants/absences.h"

#include "common/secure/digest.h"

namespace trocar::participants {

const ReturnToken* Absences::issue(ParticipantSlot slot) {
  if (kept_seconds_ == 0 || !slot.is_valid()) return nullptr;
  auto& place = places_[slot.value].emplace(Place{});
  secure::fill_random(place.token);
  return &place.token;
}

bool Absences::restore(ParticipantSlot slot, const ReturnToken& token) {
  if (kept_seconds_ == 0 || !slot.is_valid()) return false;
  places_[slot.value].emplace(Place{}).token = token;
  return true;
}

const ReturnToken* Absences::find(ParticipantSlot slot) const {
  return slot.is_valid() && places_[slot.value] ? &places_[slot.value]->token : nullptr;
}

bool Absences::is_token_of(ParticipantSlot slot, BytesView token) const {
  const auto* right = find(slot);
  return right != nullptr && secure::equal_in_constant_time(*right, token);
}

bool Absences::begin(ParticipantSlot slot, std::uint64_t now_ns) {
  if (find(slot) == nullptr) return false;
  places_[slot.value]->away_since_ns = now_ns;
  return true;
}

void Absences::end(ParticipantSlot slot) {
  if (find(slot) != nullptr) places_[slot.value]->away_since_ns.reset();
}

void Absences::forget(ParticipantSlot slot) {
  if (slot.is_valid()) places_[slot.value].reset();
}

std::vector<ParticipantSlot> Absences::expired(std::uint64_t now_ns) const {
  std::vector<ParticipantSlot> gone;
  const std::uint64_t kept_ns = kept_seconds_ * std::uint64_t{1'000'000'000};
  for (std::size_t slot = 0; slot < places_.size(); ++slot) {
    const auto& place = places_[slot];
    if (place && place->away_since_ns && now_ns - *place->away_since_ns >= kept_ns)
      gone.push_back({static_cast<std::uint8_t>(slot)});
  }
  return gone;
}

}  // namespace trocar::participants
