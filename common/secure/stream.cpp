#include "common/secure/stream.h"

#include <openssl/ssl.h>

#include <array>
#include <boost/asio/read.hpp>
#include <boost/asio/ssl/error.hpp>
#include <boost/asio/ssl/host_name_verification.hpp>
#include <boost/asio/write.hpp>

namespace trocar::secure {
namespace {

// The type of record that carries a ClientHello, and the major version in front of all of TLS.
constexpr std::uint8_t kHandshakeRecord = 0x16, kRecordVersion = 0x03;

}  // namespace

Stream::Stream(Socket socket, const TlsContext& tls)
    : content_(std::in_place_index<0>, std::move(socket)) {
  if (!tls) return;
  Socket moved = std::move(std::get<0>(content_));
  content_.emplace<1>(std::move(moved), *tls);
}

Stream::Socket& Stream::socket() {
  return has_tls() ? std::get<1>(content_).next_layer() : std::get<0>(content_);
}

asio::awaitable<Stream::Greeting> Stream::peek_greeting() {
  std::array<std::uint8_t, 2> first{};
  const auto [error, count] = co_await socket().async_receive(
      asio::buffer(first), asio::socket_base::message_peek, kNoThrow);
  if (error || count == 0) co_return Greeting::None;
  co_return is_tls_greeting(BytesView(first).first(count)) ? Greeting::Tls : Greeting::Other;
}

asio::awaitable<boost::system::error_code> Stream::accept_tls() {
  const auto [error] =
      co_await std::get<1>(content_).async_handshake(asio::ssl::stream_base::server, kNoThrow);
  co_return error;
}

asio::awaitable<boost::system::error_code> Stream::begin_tls(const std::string& host) {
  auto& tls = std::get<1>(content_);
  const bool has_ca = (SSL_get_verify_mode(tls.native_handle()) & SSL_VERIFY_PEER) != 0;
  if (has_ca) {
    boost::system::error_code ignored;
    tls.set_verify_callback(asio::ssl::host_name_verification(host), ignored);
    // It fails for addresses, which no server name may be.
    SSL_set_tlsext_host_name(tls.native_handle(), host.c_str());
  }
  const auto [error] = co_await tls.async_handshake(asio::ssl::stream_base::client, kNoThrow);
  co_return error;
}

Bytes Stream::peer_certificate_der() {
  if (!has_tls()) return {};
  return secure::peer_certificate_der(std::get<1>(content_).native_handle());
}

std::optional<DatagramKey> Stream::datagram_key() {
  if (!has_tls()) return std::nullopt;
  auto* ssl = std::get<1>(content_).native_handle();
  const auto fill = [ssl](std::span<std::uint8_t> bytes, std::string_view label) {
    return SSL_export_keying_material(ssl, bytes.data(), bytes.size(), label.data(), label.size(),
                                      nullptr, 0, 0) == 1;
  };
  DatagramKey key;
  const bool is_made = fill(key.secret, "EXPORTER-trocar-datagram-key") &&
                       fill(key.id, "EXPORTER-trocar-datagram-id");
  return is_made ? std::optional(key) : std::nullopt;
}

asio::awaitable<Transfer> Stream::read_some(asio::mutable_buffer to) {
  Transfer done;
  if (has_tls()) {
    auto [error, count] = co_await std::get<1>(content_).async_read_some(to, kNoThrow);
    done = {error, count};
  } else {
    auto [error, count] = co_await std::get<0>(content_).async_read_some(to, kNoThrow);
    done = {error, count};
  }
  co_return done;
}

asio::awaitable<Transfer> Stream::read_all(asio::mutable_buffer to) {
  Transfer done;
  if (has_tls()) {
    auto [error, count] = co_await asio::async_read(std::get<1>(content_), to, kNoThrow);
    done = {error, count};
  } else {
    auto [error, count] = co_await asio::async_read(std::get<0>(content_), to, kNoThrow);
    done = {error, count};
  }
  co_return done;
}

asio::awaitable<Transfer> Stream::write_all(const std::vector<asio::const_buffer>& buffers) {
  Transfer done;
  if (has_tls()) {
    auto [error, count] = co_await asio::async_write(std::get<1>(content_), buffers, kNoThrow);
    done = {error, count};
  } else {
    auto [error, count] = co_await asio::async_write(std::get<0>(content_), buffers, kNoThrow);
    done = {error, count};
  }
  co_return done;
}

void Stream::read_some(asio::mutable_buffer to, Done done) {
  std::visit([&](auto& below) { below.async_read_some(to, std::move(done)); }, content_);
}

void Stream::write_some(asio::const_buffer from, Done done) {
  std::visit([&](auto& below) { below.async_write_some(from, std::move(done)); }, content_);
}

std::string describe_handshake_failure(const boost::system::error_code& error) {
  if (error.category() != asio::error::get_ssl_category()) return error.message();
  switch (ERR_GET_REASON(static_cast<unsigned long>(error.value()))) {
    case SSL_R_WRONG_VERSION_NUMBER:
    case SSL_R_PACKET_LENGTH_TOO_LONG:
    case SSL_R_HTTP_REQUEST:
      return "it does not speak TLS: is it a Trocar server of this release, started without "
             "--insecure-loopback?";
    case SSL_R_CERTIFICATE_VERIFY_FAILED:
      return "its certificate is not vouched for by the CA of --ca, or is of another host";
    case SSL_R_UNSUPPORTED_PROTOCOL:
    case SSL_R_TLSV1_ALERT_PROTOCOL_VERSION:
      return "it does not speak TLS 1.3: use programs of one release";
    default:
      return "TLS failed: " + error.message();
  }
}

bool may_try_again(const boost::system::error_code& error) {
  return error == asio::error::eof || error == asio::error::connection_reset ||
         error == asio::error::broken_pipe || error == asio::ssl::error::stream_truncated;
}

bool is_tls_greeting(BytesView bytes) {
  if (bytes.empty() || bytes[0] != kHandshakeRecord) return false;
  return bytes.size() < 2 || bytes[1] == kRecordVersion;
}

}  // namespace trocar::secure
