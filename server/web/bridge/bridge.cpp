#include "server/web/bridge/bridge.h"

#include <algorithm>
#include <charconv>

#include "common/secure/certificate.h"
#include "server/web/bridge/carrier.h"

namespace trocar::bridge {
namespace {

constexpr std::size_t kMostKnownCertificates = 64;
constexpr std::size_t kMostAddressBytes = 300;

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

void Bridge::note_further(const std::string& session, const secure::HalfCode& code,
                          const std::string& address) {
  const auto colon = address.rfind(':');
  if (colon == std::string::npos || colon == 0 || address.size() > kMostAddressBytes) return;
  SessionAddress place{address, address.substr(0, colon), 0};
  if (place.host.starts_with('[') && place.host.ends_with(']'))
    place.host = place.host.substr(1, place.host.size() - 2);
  const char* end = address.data() + address.size();
  const auto parsed = std::from_chars(address.data() + colon + 1, end, place.port);
  if (place.host.empty() || parsed.ec != std::errc{} || parsed.ptr != end) return;
  auto& further = further_[session];
  if (further.code != code) further = {code, {}};
  auto& places = further.places;
  const bool is_known = std::ranges::find(places, address, &SessionAddress::name) != places.end();
  if (!is_known && places.size() < kMostFurther) places.push_back(std::move(place));
}

const Bridge::Further& Bridge::further_of(const std::string& session) const {
  static const Further kNone;
  const auto found = further_.find(session);
  return found == further_.end() ? kNone : found->second;
}

secure::HalfCode Bridge::code_of(BytesView der) {
  Bytes key(der.begin(), der.end());
  if (const auto known = known_.find(key); known != known_.end()) return known->second;
  if (known_.size() >= kMostKnownCertificates) known_.clear();
  return known_.emplace(std::move(key), secure::code_of_certificate(der)).first->second;
}

}  // namespace trocar::bridge
