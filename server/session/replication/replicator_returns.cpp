// The replicator's part about who has lost the connection and comes back.

#include <algorithm>

#include "common/base/log.h"
#include "server/session/replication/replicator_client.h"

namespace trocar::replication {

bool Replicator::keep_place(Client& client) {
  if (!client.is_welcome || barrier_) return false;
  const auto& participant = *client.participant;
  const auto slot = participant.slot;
  if (!absences_.begin(slot, options_.clock_ns())) return false;
  log::info("{} ({}) has lost the connection, the seat is kept for {} s", participant.name,
            participants::name_of(participant.role), absences_.kept_seconds());
  ++counters_.lost;
  if (options_.gate) options_.gate->note_action(client.applicant, "lost");
  roster_.set_away(slot, true);
  session_.has_changed = true;
  away_[slot] = std::move(clients_.extract(client.id).mapped());
  return true;
}

bool Replicator::restore(participants::Participant who, const participants::ReturnToken& token,
                         std::uint32_t code) {
  const auto slot = who.slot;
  if (roster_.find(who.name) || !absences_.restore(slot, token)) return false;
  absences_.begin(slot, options_.clock_ns());
  who.is_away = true;
  auto client = std::make_unique<Client>(connections_, 0, options_, counters_);
  client->applicant = {{}, who.name, who.role, code};
  client->is_welcome = true;
  client->participant = who;
  if (slot.has_tools()) inbox_.note_hand();
  roster_.restore(std::move(who));
  away_[slot] = std::move(client);
  session_.has_changed = true;
  return true;
}

void Replicator::end_absences(std::uint64_t now_ns) {
  for (const auto slot : absences_.expired(now_ns)) {
    const auto client = std::move(away_.extract(slot).mapped());
    log::info("{} has not come back", client->participant->name);
    leave(*client);
  }
}

std::uint32_t Replicator::code_of(ParticipantSlot slot) const {
  const auto* client = client_of(slot);
  return client == nullptr ? 0 : client->applicant.code;
}

void Replicator::put_out_revoked() {
  auto* gate = options_.gate;
  if (!gate || !gate->refresh()) return;
  for (auto next = clients_.begin(); next != clients_.end();) {
    auto& client = *next->second;
    ++next;  // ending a session erases it
    if (client.is_welcome && gate->puts_out(client.applicant))
      end_session(client, {EndReason::CodeRevoked,
                           "join code: the host has revoked the code that you came with"});
  }
  std::erase_if(away_, [&](const auto& entry) {
    const bool has_to_go = gate->puts_out(entry.second->applicant);
    if (has_to_go) leave(*entry.second);
    return has_to_go;
  });
}

const participants::Participant* Replicator::find_own_place(const HelloRequest& request) const {
  if (request.return_token.empty()) return nullptr;
  // The client knows the name that it came with, whatever it was renamed to.
  const participants::Participant* own = nullptr;
  const auto look_at = [&](const Client& client) {
    if (!client.participant) return;
    const bool is_named =
        client.applicant.name == request.name || client.participant->name == request.name;
    const auto slot = client.participant->slot;
    if (is_named && absences_.is_token_of(slot, request.return_token)) own = roster_.find(slot);
  };
  for (const auto& [id, client] : clients_) look_at(*client);
  for (const auto& [slot, client] : away_) look_at(*client);
  return own;
}

std::optional<Ending> Replicator::come_back(Client& client,
                                            const participants::Participant& place) {
  const auto slot = place.slot;
  // The old connection may hang without that anybody has noticed.
  const auto old = std::ranges::find_if(clients_, [&](const auto& entry) {
    return entry.second->participant && entry.second->participant->slot == slot;
  });
  const bool hangs = old != clients_.end();
  const auto before =
      std::move(hangs ? clients_.extract(old).mapped() : away_.extract(slot).mapped());
  if (hangs) connections_.close(before->id);
  absences_.end(slot);
  roster_.set_away(slot, false);
  client.participant = before->participant;
  client.applicant.role = before->applicant.role;
  client.applicant.name = before->applicant.name;
  client.applicant.code = before->applicant.code;
  ++counters_.returned;
  log::info("{} ({}) is back{}", place.name, participants::name_of(place.role),
            hangs ? ", the old connection still hung" : "");
  if (options_.gate) options_.gate->note_action(client.applicant, "back");
  return welcome(client);
}

}  // namespace trocar::replication
