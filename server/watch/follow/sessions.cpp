#include "server/watch/follow/sessions.h"

#include <algorithm>
#include <charconv>

#include "common/secure/certificate.h"

namespace trocar::follow {
namespace {

constexpr std::size_t kMostKnownCertificates = 64;
constexpr std::size_t kMostAddressBytes = 300;

}  // namespace

Sessions::Sessions(std::vector<SessionAddress> known)
    : known_(std::move(known)), tls_(secure::make_client_context()) {}

const SessionAddress* Sessions::find(const std::string& name) const {
  if (name.empty() && !known_.empty()) return &known_.front();
  const auto found = std::ranges::find(known_, name, &SessionAddress::name);
  return found == known_.end() ? nullptr : &*found;
}

void Sessions::add(SessionAddress session) {
  if (std::ranges::find(known_, session.name, &SessionAddress::name) == known_.end())
    known_.push_back(std::move(session));
}

void Sessions::remove(const std::string& name) {
  std::erase_if(known_, [&name](const SessionAddress& one) { return one.name == name; });
  further_.erase(name);
}

void Sessions::note_further(const std::string& session, const secure::HalfCode& code,
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

const Sessions::Further& Sessions::further_of(const std::string& session) const {
  static const Further kNone;
  const auto found = further_.find(session);
  return found == further_.end() ? kNone : found->second;
}

secure::HalfCode Sessions::code_of(BytesView der) {
  Bytes key(der.begin(), der.end());
  if (const auto known = certificates_.find(key); known != certificates_.end())
    return known->second;
  if (certificates_.size() >= kMostKnownCertificates) certificates_.clear();
  return certificates_.emplace(std::move(key), secure::code_of_certificate(der)).first->second;
}

}  // namespace trocar::follow
