#include "server/watch/page/bridge.h"

#include <algorithm>

namespace trocar::page {

Bridge::Bridge(std::vector<follow::SessionAddress> known, int most_connections,
               int most_connections_per_address)
    : sessions(std::move(known)),
      observers(intake::places_for_observers(most_connections),
                intake::places_for_observers(most_connections_per_address)) {}

std::shared_ptr<Carrier> Bridge::carrier_of(const follow::SessionAddress& session, wire::Role role,
                                            const asio::any_io_executor& executor) {
  const bool is_shared = role == wire::Role::Observer;
  auto& place = carriers_[session.name];
  if (auto carrier = place.lock(); is_shared && carrier && !carrier->has_ended()) return carrier;
  auto carrier = std::make_shared<Carrier>(executor, sessions, counters, session);
  if (is_shared) place = carrier;
  carrier->start();
  return carrier;
}

std::shared_ptr<SessionUse> Bridge::use_of(const std::string& session) {
  auto& use = uses[session];
  if (!use) use = std::make_shared<SessionUse>();
  return use;
}

void Bridge::note_leader(const std::string& session, const secure::JoinCode& code) {
  leaders_.emplace_back(session, code);
}

void Bridge::forget_leader(const std::string& session, const secure::JoinCode& code) {
  const auto found = std::ranges::find(leaders_, std::pair(session, code));
  if (found != leaders_.end()) leaders_.erase(found);
}

bool Bridge::has_leader(const std::string& session, const secure::JoinCode& code) const {
  return std::ranges::find(leaders_, std::pair(session, code)) != leaders_.end();
}

}  // namespace trocar::page
