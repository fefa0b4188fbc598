#include "client/net/way_in.h"

#include "common/secure/link_file.h"
#include "common/secure/loopback.h"

namespace trocar::net {

Status set_way_in(const WayIn& way_in, NetSourceOptions& options) {
  const bool is_loopback = secure::is_loopback(options.host);
  if (way_in.is_insecure) {
    if (is_loopback) return {};
    return Error{ErrorCode::Usage,
                 "--insecure-loopback: " + options.host +
                     " is no address of this machine: use it with 127.0.0.1 or [::1]"};
  }
  // Whatever that name leads to: the link file's code says whose certificate it must be.
  if (way_in.join.empty() && !is_loopback && options.host != "localhost")
    return Error{ErrorCode::Usage, "--server: " + options.host +
                                       " is another machine: give --join CODE as its server "
                                       "printed it"};
  if (way_in.ca_file.empty()) {
    options.tls = secure::make_client_context();
  } else {
    auto tls = secure::make_client_context_with_ca(way_in.ca_file);
    if (!tls) return tls.error();
    options.tls = std::move(*tls);
    options.trusts_ca = true;
  }
  if (way_in.join.empty()) {
    options.join_code = [port = options.port, role = way_in.role] {
      return secure::read_link_file(port, role);
    };
  } else {
    options.join_code = [text = way_in.join]() -> Result<secure::JoinCode> {
      const auto invitation = secure::parse_invitation(text);
      if (!invitation) return invitation.error();
      return invitation->code;
    };
  }
  return {};
}

}  // namespace trocar::net
