#include "server/web/bridge/bridge.h"

#include <algorithm>

#include "common/secure/certificate.h"
#include "server/web/bridge/carrier.h"

namespace trocar::bridge {
namespace {

constexpr std::size_t kMostKnownCertificates = 64;

}  // namespace

Bridge::Bridge(std::vector<SessionAddress> sessions)
    : sessions_(std::move(sessions)), tls_(secure::make_client_context()) {}
Bridge::~Bridge() = default;

const SessionAddress* Bridge::find_session(const std::string& name) const {
  if (name.empty() && !sessions_.empty()) return &sessions_.front();
  const auto found = std::ranges::find(sessions_, name, &SessionAddress::name);
  return found == sessions_.end() ? nullptr : &*found;
}

std::shared_ptr<Carrier> Bridge::carrier_of(const SessionAddress& session,
                                            const asio::any_io_executor& executor) {
  auto& place = carriers_[session.name];
  if (auto carrier = place.lock(); carrier && !carrier->has_ended()) return carrier;
  auto carrier = std::make_shared<Carrier>(executor, *this, session);
  place = carrier;
  carrier->start();
  return carrier;
}

secure::HalfCode Bridge::code_of(BytesView der) {
  Bytes key(der.begin(), der.end());
  if (const auto known = known_.find(key); known != known_.end()) return known->second;
  if (known_.size() >= kMostKnownCertificates) known_.clear();
  return known_.emplace(std::move(key), secure::code_of_certificate(der)).first->second;
}

}  // namespace trocar::bridge
