#include "common/secure/public_host.h"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>

namespace trocar::secure {
namespace {

// The address from which packets to other networks leave; empty without such a network. Connecting
// a socket for datagrams sends nothing.
std::string routed_address() {
  sockaddr_in to{}, from{};
  to.sin_family = AF_INET;
  to.sin_port = htons(9);
  ::inet_pton(AF_INET, "192.0.2.1", &to.sin_addr);  // an example of RFC 5737, which nobody has
  socklen_t size = sizeof from;
  const int datagrams = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (datagrams < 0) return {};
  const bool is_found =
      ::connect(datagrams, reinterpret_cast<const sockaddr*>(&to), sizeof to) == 0 &&
      ::getsockname(datagrams, reinterpret_cast<sockaddr*>(&from), &size) == 0;
  ::close(datagrams);
  std::array<char, INET_ADDRSTRLEN> text{};
  if (!is_found || !::inet_ntop(AF_INET, &from.sin_addr, text.data(), text.size())) return {};
  return text.data();
}

}  // namespace

std::string public_host(const std::string& listens_at) {
  const bool is_any = listens_at == "0.0.0.0" || listens_at == "::";
  if (!is_any)
    return listens_at.find(':') == std::string::npos ? listens_at : "[" + listens_at + "]";
  if (auto routed = routed_address(); !routed.empty()) return routed;
  std::string found = "HOST";
  ifaddrs* all = nullptr;
  if (::getifaddrs(&all) != 0) return found;
  for (const auto* entry = all; entry != nullptr && found == "HOST"; entry = entry->ifa_next) {
    const bool is_up = (entry->ifa_flags & IFF_UP) != 0 && (entry->ifa_flags & IFF_LOOPBACK) == 0;
    if (entry->ifa_addr == nullptr || entry->ifa_addr->sa_family != AF_INET || !is_up) continue;
    std::array<char, INET_ADDRSTRLEN> text{};
    const auto* address = reinterpret_cast<const sockaddr_in*>(entry->ifa_addr);
    if (::inet_ntop(AF_INET, &address->sin_addr, text.data(), text.size())) found = text.data();
  }
  ::freeifaddrs(all);
  return found;
}

}  // namespace trocar::secure
