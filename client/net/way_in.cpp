#include "client/net/way_in.h"

#include "common/secure/join_code.h"
#include "common/secure/link_file.h"
#include "common/secure/loopback.h"

namespace trocar::net {

Status set_security(const WayIn& way, NetSourceOptions& connection) {
  const bool is_loopback = secure::is_loopback(connection.host);
  if (way.is_insecure) {
    if (is_loopback) return {};
    return Error{ErrorCode::Usage,
                 "--insecure-loopback: " + connection.host +
                     " is no address of this machine: use it with 127.0.0.1 or [::1]"};
  }
  // Whatever that name leads to: the link file's code says whose certificate it must be.
  if (way.join.empty() && !is_loopback && connection.host != "localhost")
    return Error{ErrorCode::Usage, "--server: " + connection.host +
                                       " is another machine: give --join CODE as its server "
                                       "printed it"};
  if (way.ca_file.empty()) {
    connection.tls = secure::make_client_context();
  } else {
    auto tls = secure::make_client_context_with_ca(way.ca_file);
    if (!tls) return tls.error();
    connection.tls = std::move(*tls);
    connection.trusts_ca = true;
  }
  if (way.join.empty()) {
    connection.join_code = [port = connection.port, role = wire::name_of(way.role)] {
      return secure::read_link_file(port, role);
    };
  } else {
    connection.join_code = [text = way.join]() -> Result<secure::JoinCode> {
      const auto invitation = secure::parse_invitation(text);
      if (!invitation) return invitation.error();
      return invitation->code;
    };
  }
  return {};
}

Status ending_of(const replica::CloseReason& reason) {
  switch (reason.kind) {
    case replica::CloseKind::Refused:
      return Error{ErrorCode::Refused, reason.text};
    case replica::CloseKind::Unreachable:
    case replica::CloseKind::Lost:
      return Error{ErrorCode::ResourceMissing, reason.text};
    case replica::CloseKind::None:
    case replica::CloseKind::Ended:
      break;
  }
  return {};
}

}  // namespace trocar::net
