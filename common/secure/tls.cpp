#include "common/secure/tls.h"

#include <openssl/ssl.h>
#include <openssl/x509.h>

#include <boost/asio/buffer.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/ssl/verify_mode.hpp>

#include "common/secure/digest.h"

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wshadow"
#include <boost/asio/ssl/impl/src.hpp>
#pragma GCC diagnostic pop

namespace trocar::secure {
namespace {

TlsContext make_context(asio::ssl::context::method method) {
  auto context = std::make_shared<asio::ssl::context>(method);
  auto* native = context->native_handle();
  const bool is_set = SSL_CTX_set_min_proto_version(native, TLS1_3_VERSION) == 1 &&
                      SSL_CTX_set_max_proto_version(native, TLS1_3_VERSION) == 1 &&
                      SSL_CTX_set_num_tickets(native, 0) == 1;
  TROCAR_ASSERT(is_set);
  SSL_CTX_set_session_cache_mode(native, SSL_SESS_CACHE_OFF);
  SSL_CTX_set_mode(native, SSL_MODE_RELEASE_BUFFERS);
  return context;
}

}  // namespace

Result<TlsContext> make_server_context(const Identity& identity, const std::string& name) {
  auto context = make_context(asio::ssl::context::tls_server);
  boost::system::error_code error;
  context->use_certificate_chain(asio::buffer(identity.certificate_pem), error);
  if (!error)
    context->use_private_key(asio::buffer(identity.key_pem), asio::ssl::context::pem, error);
  if (!error && SSL_CTX_check_private_key(context->native_handle()) == 1) return context;
  const std::string why = error ? error.message() : last_openssl_error();
  return Error{ErrorCode::BadFile, name + ": cannot be used as certificate and key (" + why +
                                       "): both must be PEM, without a password, and of one pair"};
}

TlsContext make_client_context() {
  auto context = make_context(asio::ssl::context::tls_client);
  context->set_verify_mode(asio::ssl::verify_none);
  return context;
}

Result<TlsContext> make_client_context_with_ca(const std::string& ca_file) {
  auto context = make_context(asio::ssl::context::tls_client);
  boost::system::error_code error;
  context->load_verify_file(ca_file, error);
  if (error)
    return Error{ErrorCode::BadFile,
                 "--ca: " + ca_file + ": holds no certificate of a CA: it must be PEM"};
  context->set_verify_mode(asio::ssl::verify_peer);
  return context;
}

TlsContext make_client_context_with_system_cas() {
  auto context = make_context(asio::ssl::context::tls_client);
  boost::system::error_code ignored;  // without any of them nobody is vouched for
  context->set_default_verify_paths(ignored);
  context->set_verify_mode(asio::ssl::verify_peer);
  return context;
}

Bytes peer_certificate_der(const ssl_st* connection) {
  X509* certificate = SSL_get1_peer_certificate(connection);
  if (certificate == nullptr) return {};
  Bytes der(static_cast<std::size_t>(i2d_X509(certificate, nullptr)));
  auto* to = der.data();
  i2d_X509(certificate, &to);
  X509_free(certificate);
  return der;
}

}  // namespace trocar::secure
