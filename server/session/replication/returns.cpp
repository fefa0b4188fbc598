#include "server/session/replication/returns.h"

#include "common/base/log.h"

namespace trocar::replication {

bool Returns::keep(std::unique_ptr<Speaker>& who) {
  const auto& participant = *who->participant;
  const auto slot = participant.slot;
  if (!absences_.begin(slot, session_.now_ns())) return false;
  log::info("{} ({}) has lost the connection, the seat is kept for {} s", participant.name,
            participants::name_of(participant.role), absences_.kept_seconds());
  ++counters_.lost;
  if (auto* gate = session_.options.gate) gate->note_action(who->applicant, "lost");
  session_.roster.set_away(slot, true);
  session_.has_changed = true;
  away_[slot] = std::move(who);
  return true;
}

bool Returns::restore(participants::Participant who, const participants::ReturnToken& token,
                      std::uint32_t code) {
  const auto slot = who.slot;
  if (session_.roster.find(who.name) || !absences_.restore(slot, token)) return false;
  absences_.begin(slot, session_.now_ns());
  who.is_away = true;
  auto speaker = std::make_unique<Speaker>(0, session_.options);
  speaker->applicant = {{}, who.name, who.role, code};
  speaker->participant = who;
  if (slot.has_tools()) session_.inbox.note_hand();
  session_.roster.restore(std::move(who));
  away_[slot] = std::move(speaker);
  session_.has_changed = true;
  return true;
}

const participants::Participant* Returns::find_own_place(const HelloRequest& request) const {
  if (request.return_token.empty()) return nullptr;
  // The client knows the name that it came with, whatever it was renamed to.
  const participants::Participant* own = nullptr;
  for (const auto& one : session_.roster.list()) {
    const auto* who = session_.audience.find(one.slot);
    const bool is_named = who && (who->applicant.name == request.name || one.name == request.name);
    if (is_named && absences_.is_token_of(one.slot, request.return_token))
      own = session_.roster.find(one.slot);
  }
  return own;
}

void Returns::come_back(Speaker& who, const Speaker& before) {
  const auto slot = before.participant->slot;
  absences_.end(slot);
  session_.roster.set_away(slot, false);
  who.participant = before.participant;
  who.applicant.role = before.applicant.role;
  who.applicant.name = before.applicant.name;
  who.applicant.code = before.applicant.code;
  ++counters_.returned;
  if (auto* gate = session_.options.gate) gate->note_action(who.applicant, "back");
}

Speaker* Returns::find(ParticipantSlot slot) const {
  const auto found = away_.find(slot);
  return found == away_.end() ? nullptr : found->second.get();
}

std::unique_ptr<Speaker> Returns::take(ParticipantSlot slot) {
  auto node = away_.extract(slot);
  return node ? std::move(node.mapped()) : nullptr;
}

std::vector<std::unique_ptr<Speaker>> Returns::take_expired(std::uint64_t now_ns) {
  std::vector<std::unique_ptr<Speaker>> taken;
  for (const auto slot : absences_.expired(now_ns)) {
    taken.push_back(take(slot));
    log::info("{} has not come back", taken.back()->participant->name);
  }
  return taken;
}

std::vector<std::unique_ptr<Speaker>> Returns::take_revoked() {
  std::vector<std::unique_ptr<Speaker>> taken;
  for (auto& [slot, who] : away_)
    if (session_.options.gate->puts_out(who->applicant)) taken.push_back(std::move(who));
  std::erase_if(away_, [](const auto& one) { return !one.second; });
  return taken;
}

}  // namespace trocar::replication
