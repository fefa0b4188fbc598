#include "server/watch/page/bridge.h"

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

}  // namespace trocar::page
