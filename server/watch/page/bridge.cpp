#include "server/watch/page/bridge.h"

namespace trocar::page {

std::shared_ptr<Carrier> Bridge::carrier_of(const follow::SessionAddress& session,
                                            const asio::any_io_executor& executor) {
  auto& place = carriers_[session.name];
  if (auto carrier = place.lock(); carrier && !carrier->has_ended()) return carrier;
  auto carrier = std::make_shared<Carrier>(executor, sessions, counters, session);
  place = carrier;
  carrier->start();
  return carrier;
}

}  // namespace trocar::page
