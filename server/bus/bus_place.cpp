#include "server/bus/bus_place.h"

#include <algorithm>

namespace trocar::bus {

// Each address has the scheme of the first: one that is read otherwise would be reached without
// TLS.
Status check_place(const BusPlace& place) {
  const auto& url = place.url;
  if (url.find('@') != std::string::npos)
    return Error{ErrorCode::Usage,
                 "--nats: the URL names a user, whose password all users of this machine could "
                 "read: use --nats-creds FILE"};
  for (std::size_t begin = 0; begin <= url.size();) {
    const auto comma = std::min(url.find(',', begin), url.size());
    const auto address = url.substr(begin, comma - begin);
    const bool is_tls = address.starts_with("tls://");
    if (is_tls != place.wants_tls())
      return Error{ErrorCode::Usage,
                   "--nats: '" + url + "' has addresses with tls:// and others without"};
    const bool is_known = is_tls || address.starts_with("nats://");
    if (!is_known || address.ends_with("//") || address.find(' ') != std::string::npos)
      return Error{ErrorCode::Usage,
                   "--nats: '" + address + "' is neither nats://HOST:PORT nor tls://HOST:PORT"};
    begin = comma + 1;
  }
  if (!place.ca_file.empty() && !place.wants_tls())
    return Error{ErrorCode::Usage, "--nats-ca: needs --nats tls://HOST:PORT"};
  return {};
}

}  // namespace trocar::bus
