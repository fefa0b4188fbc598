#include "common/discovery/finder.h"

#include <avahi-client/client.h>
#include <avahi-client/lookup.h>
#include <avahi-common/error.h>
#include <avahi-common/simple-watch.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "common/base/timing.h"
#include "common/discovery/avahi_text.h"

namespace trocar::discovery {
namespace {

constexpr std::size_t kMostRecords = 16;

// Everything happens on the caller's thread.
class Finder {
 public:
  ~Finder() {
    if (client_ != nullptr) avahi_client_free(client_);  // with browser and resolvers
    if (poll_ != nullptr) avahi_simple_poll_free(poll_);
  }
  Status begin();
  Status look(double seconds);
  std::vector<FoundSession> sessions() && { return std::move(found_); }

 private:
  static void on_client(AvahiClient*, AvahiClientState state, void* self) {
    if (state == AVAHI_CLIENT_FAILURE) static_cast<Finder*>(self)->is_lost_ = true;
  }
  static void on_browse(AvahiServiceBrowser*, AvahiIfIndex interface, AvahiProtocol protocol,
                        AvahiBrowserEvent event, const char* name, const char* type,
                        const char* domain, AvahiLookupResultFlags, void* self);
  static void on_resolve(AvahiServiceResolver* resolver, AvahiIfIndex, AvahiProtocol,
                         AvahiResolverEvent event, const char* name, const char*, const char*,
                         const char*, const AvahiAddress* address, std::uint16_t port,
                         AvahiStringList* text, AvahiLookupResultFlags, void* self);
  Status lost(int error) const {
    return Error{ErrorCode::ResourceMissing, std::string("--list: no Avahi daemon answers (") +
                                                 avahi_strerror(error) +
                                                 "): start avahi-daemon, or ask for the address"};
  }

  AvahiSimplePoll* poll_ = nullptr;
  AvahiClient* client_ = nullptr;
  bool is_lost_ = false;
  std::size_t resolvers_ = 0;
  std::vector<FoundSession> found_;
};

Status Finder::begin() {
  int error = AVAHI_ERR_NO_MEMORY;
  poll_ = avahi_simple_poll_new();
  if (poll_ != nullptr)
    client_ = avahi_client_new(avahi_simple_poll_get(poll_), {}, on_client, this, &error);
  if (client_ == nullptr) return lost(error);
  const auto* browser = avahi_service_browser_new(client_, AVAHI_IF_UNSPEC, AVAHI_PROTO_INET,
                                                  kServiceType, nullptr, {}, on_browse, this);
  return browser != nullptr ? Status() : lost(avahi_client_errno(client_));
}

Status Finder::look(double seconds) {
  const auto end_ns = monotonic_ns() + static_cast<std::uint64_t>(seconds * 1e9);
  constexpr int kSleepMs = 50;
  while (monotonic_ns() < end_ns && !is_lost_)
    if (avahi_simple_poll_iterate(poll_, kSleepMs) != 0) break;
  return is_lost_ ? lost(avahi_client_errno(client_)) : Status();
}

void Finder::on_browse(AvahiServiceBrowser*, AvahiIfIndex interface, AvahiProtocol protocol,
                       AvahiBrowserEvent event, const char* name, const char* type,
                       const char* domain, AvahiLookupResultFlags, void* self) {
  auto& finder = *static_cast<Finder*>(self);
  if (event != AVAHI_BROWSER_NEW || finder.resolvers_ >= 2 * kMostSessions) return;
  if (avahi_service_resolver_new(finder.client_, interface, protocol, name, type, domain,
                                 AVAHI_PROTO_INET, {}, on_resolve, self) != nullptr)
    ++finder.resolvers_;
}

void Finder::on_resolve(AvahiServiceResolver* resolver, AvahiIfIndex, AvahiProtocol,
                        AvahiResolverEvent event, const char* name, const char*, const char*,
                        const char*, const AvahiAddress* address, std::uint16_t port,
                        AvahiStringList* text, AvahiLookupResultFlags, void* self) {
  auto& found = static_cast<Finder*>(self)->found_;
  if (event == AVAHI_RESOLVER_FOUND && found.size() < kMostSessions) {
    std::array<char, AVAHI_ADDRESS_STR_MAX> where{};
    avahi_address_snprint(where.data(), where.size(), address);
    found.push_back({from_txt(name, from_list(text, kMostRecords)), where.data(), port});
  }
  avahi_service_resolver_free(resolver);
}

}  // namespace

Result<std::vector<FoundSession>> find_sessions(double seconds) {
  Finder finder;
  if (const auto begun = finder.begin(); !begun) return begun.error();
  if (const auto looked = finder.look(seconds); !looked) return looked.error();
  auto sessions = std::move(finder).sessions();
  // A machine with two networks is heard on both; its own loopback says nothing to others.
  std::ranges::stable_sort(sessions, {}, [](const FoundSession& s) {
    return std::pair(s.notice.name, s.address.starts_with("127."));
  });
  const auto same = [](const FoundSession& a, const FoundSession& b) {
    return a.notice.name == b.notice.name && a.port == b.port;
  };
  sessions.erase(std::unique(sessions.begin(), sessions.end(), same), sessions.end());
  return sessions;
}

std::string to_table(const std::vector<FoundSession>& sessions) {
  if (sessions.empty()) return "no session announces itself on this network\n";
  constexpr const char* kRow = "{:<32}  {:<16}  {:>6}  {:<4}  {}\n";
  std::string table = fmt::format(kRow, "session", "organ", "people", "code", "address");
  for (const auto& [notice, address, port] : sessions)
    table += fmt::format(kRow, notice.name, notice.organ, notice.people,
                         notice.needs_code ? "yes" : "no", fmt::format("{}:{}", address, port));
  return table;
}

}  // namespace trocar::discovery
