#pragma once

// Contexts of TLS 1.3 and nothing older. A server's holds its certificate and key. A client's
// either trusts a CA, which also vouches for the host's name, or takes any certificate, and the
// client compares it with the join code before it sends anything.
//
// No tickets, no resumption, no early data: each connection makes its own keys.

#include <memory>
#include <string>

#include "common/base/asio.h"
#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/secure/certificate.h"

namespace boost::asio::ssl {
class context;
}
struct ssl_st;

namespace trocar::secure {

// Null means a connection without TLS.
using TlsContext = std::shared_ptr<asio::ssl::context>;

// `name`: of the files, for the error.
Result<TlsContext> make_server_context(const Identity& identity, const std::string& name);
TlsContext make_client_context();
Result<TlsContext> make_client_context_with_ca(const std::string& ca_file);
// It trusts the authorities that this machine trusts.
TlsContext make_client_context_with_system_cas();

// Returns the certificate of the other end; empty before the handshake.
Bytes peer_certificate_der(const ssl_st* connection);

}  // namespace trocar::secure
