#include "common/secure/datagram_channel.h"

#include <openssl/bio.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <sys/time.h>

#include <algorithm>
#include <cstring>
#include <string_view>

#include "common/base/assert.h"

namespace trocar::secure {

struct DatagramChannel::Core {
  SSL* ssl = nullptr;
  Send send;
  BytesView incoming;  // valid during receive()
  State state = State::Shaking;
  DatagramKey key;                              // client: its own; server: the peer's
  const DatagramListener::FindKey* find_key{};  // server
  std::string peer;                             // server: what its cookie is made of
  const Digest* cookie_key = nullptr;
  Bytes plain = Bytes(kDatagramBytes);

  ~Core() { SSL_free(ssl); }
  void shake();
  void drain(const Deliver& deliver);
};

namespace {

constexpr unsigned kFirstTimeoutUs = 250'000, kLongestTimeoutUs = 2'000'000;
constexpr std::size_t kCookieBytes = 16;
constexpr std::size_t kRecordHeaderBytes = 13;  // type, version, epoch, number, length
constexpr std::uint8_t kAlert = 21;
constexpr std::size_t kSealBytes = 8 + 16;  // explicit nonce and tag

using Core = DatagramChannel::Core;
using State = DatagramChannel::State;

// OpenSSL ends a connection for a record that is too short to be sealed, and a handshake for an
// alert in the open. Anybody can send these: a datagram that has one is nobody's.
bool may_be_of_peer(BytesView datagram) {
  while (datagram.size() >= kRecordHeaderBytes) {
    const bool is_sealed = datagram[3] != 0 || datagram[4] != 0;
    const auto size = static_cast<std::size_t>(datagram[11] << 8 | datagram[12]);
    if (is_sealed ? size < kSealBytes : datagram[0] == kAlert) return false;
    datagram = datagram.subspan(std::min(datagram.size(), kRecordHeaderBytes + size));
  }
  return true;
}

Core& core_of(const SSL* ssl) {
  return *static_cast<Core*>(SSL_get_app_data(ssl));
}

// ---- OpenSSL's view of the network: one datagram per read and per write ----

int write_datagram(BIO* bio, const char* bytes, int count) {
  auto* core = static_cast<Core*>(BIO_get_data(bio));
  const auto* first = reinterpret_cast<const std::uint8_t*>(bytes);
  core->send(BytesView(first, static_cast<std::size_t>(count)));
  return count;
}

int read_datagram(BIO* bio, char* to, int room) {
  auto* core = static_cast<Core*>(BIO_get_data(bio));
  BIO_clear_retry_flags(bio);
  if (core->incoming.empty()) {
    BIO_set_retry_read(bio);
    return -1;
  }
  const auto count = std::min(core->incoming.size(), static_cast<std::size_t>(room));
  std::memcpy(to, core->incoming.data(), count);
  core->incoming = {};
  return static_cast<int>(count);
}

long control_datagrams(BIO*, int command, long, void*) {
  switch (command) {
    case BIO_CTRL_FLUSH:
      return 1;
    case BIO_CTRL_DGRAM_QUERY_MTU:
    case BIO_CTRL_DGRAM_GET_FALLBACK_MTU:
      return static_cast<long>(kDatagramBytes);
    default:
      return 0;
  }
}

BIO_METHOD* datagram_method() {
  static BIO_METHOD* const method = [] {
    auto* made = BIO_meth_new(BIO_get_new_index() | BIO_TYPE_SOURCE_SINK, "datagrams");
    TROCAR_ASSERT(made != nullptr);
    BIO_meth_set_write(made, write_datagram);
    BIO_meth_set_read(made, read_datagram);
    BIO_meth_set_ctrl(made, control_datagrams);
    return made;
  }();
  return method;
}

// ---- what OpenSSL asks ----

unsigned client_key(SSL* ssl, const char*, char* identity, unsigned identity_room,
                    unsigned char* key, unsigned key_room) {
  const auto& own = core_of(ssl).key;
  const auto name = to_hex(own.id);
  if (identity_room <= name.size() || key_room < own.secret.size()) return 0;
  std::memcpy(identity, name.c_str(), name.size() + 1);
  std::copy(own.secret.begin(), own.secret.end(), key);
  return static_cast<unsigned>(own.secret.size());
}

unsigned server_key(SSL* ssl, const char* identity, unsigned char* key, unsigned key_room) {
  auto& core = core_of(ssl);
  const auto id = from_hex(identity);
  if (id.size() != core.key.id.size()) return 0;
  std::copy(id.begin(), id.end(), core.key.id.begin());
  const auto secret = (*core.find_key)(core.key.id);
  if (!secret || key_room < secret->size()) return 0;
  std::copy(secret->begin(), secret->end(), key);
  return static_cast<unsigned>(secret->size());
}

Digest cookie_of(const Core& core) {
  return hmac_sha256(*core.cookie_key, bytes_of(std::string_view(core.peer)));
}

int make_cookie(SSL* ssl, unsigned char* cookie, unsigned* size) {
  const auto digest = cookie_of(core_of(ssl));
  std::copy_n(digest.begin(), kCookieBytes, cookie);
  *size = kCookieBytes;
  return 1;
}

int check_cookie(SSL* ssl, const unsigned char* cookie, unsigned size) {
  const auto digest = cookie_of(core_of(ssl));
  return equal_in_constant_time(BytesView(cookie, size), BytesView(digest).first(kCookieBytes));
}

unsigned next_timer(SSL*, unsigned last_us) {
  return last_us == 0 ? kFirstTimeoutUs : std::min(2 * last_us, kLongestTimeoutUs);
}

// ---- contexts ----

SSL_CTX* make_datagram_context() {
  auto* context = SSL_CTX_new(DTLS_method());
  TROCAR_ASSERT(context != nullptr);
  const bool is_set = SSL_CTX_set_min_proto_version(context, DTLS1_2_VERSION) == 1 &&
                      SSL_CTX_set_max_proto_version(context, DTLS1_2_VERSION) == 1 &&
                      SSL_CTX_set_cipher_list(context, "PSK-AES256-GCM-SHA384") == 1;
  TROCAR_ASSERT(is_set);
  SSL_CTX_set_options(context, SSL_OP_NO_QUERY_MTU | SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_TICKET |
                                   SSL_OP_COOKIE_EXCHANGE);
  SSL_CTX_set_session_cache_mode(context, SSL_SESS_CACHE_OFF);
  SSL_CTX_set_psk_client_callback(context, client_key);
  SSL_CTX_set_psk_server_callback(context, server_key);
  SSL_CTX_set_cookie_generate_cb(context, make_cookie);
  SSL_CTX_set_cookie_verify_cb(context, check_cookie);
  return context;
}

SSL_CTX* datagram_context() {
  static SSL_CTX* const context = make_datagram_context();
  return context;
}

std::unique_ptr<Core> make_core(DatagramChannel::Send send) {
  auto core = std::make_unique<Core>();
  core->send = std::move(send);
  core->ssl = SSL_new(datagram_context());
  TROCAR_ASSERT(core->ssl != nullptr);
  SSL_set_app_data(core->ssl, core.get());
  auto* bio = BIO_new(datagram_method());
  TROCAR_ASSERT(bio != nullptr);
  BIO_set_data(bio, core.get());
  BIO_set_init(bio, 1);
  SSL_set_bio(core->ssl, bio, bio);  // which takes the BIO over
  DTLS_set_link_mtu(core->ssl, kDatagramBytes);
  DTLS_set_timer_cb(core->ssl, next_timer);
  return core;
}

}  // namespace

void DatagramChannel::Core::shake() {
  ERR_clear_error();
  const int done = SSL_do_handshake(ssl);
  if (done == 1)
    state = State::Open;
  else if (SSL_get_error(ssl, done) != SSL_ERROR_WANT_READ)
    state = State::Failed;
  ERR_clear_error();
}

void DatagramChannel::Core::drain(const Deliver& deliver) {
  while (state == State::Open) {
    ERR_clear_error();
    const int count = SSL_read(ssl, plain.data(), static_cast<int>(plain.size()));
    if (count <= 0) {
      if (SSL_get_error(ssl, count) != SSL_ERROR_WANT_READ) state = State::Failed;
      break;
    }
    deliver(BytesView(plain).first(static_cast<std::size_t>(count)));
  }
  ERR_clear_error();
}

DatagramChannel::DatagramChannel(std::unique_ptr<Core> core) : core_(std::move(core)) {}
DatagramChannel::~DatagramChannel() = default;

std::unique_ptr<DatagramChannel> DatagramChannel::make_client(const DatagramKey& key, Send send) {
  auto core = make_core(std::move(send));
  core->key = key;
  SSL_set_connect_state(core->ssl);
  return std::unique_ptr<DatagramChannel>(new DatagramChannel(std::move(core)));
}

void DatagramChannel::start() {
  core_->shake();
}

State DatagramChannel::receive(BytesView datagram, const Deliver& deliver) {
  if (!may_be_of_peer(datagram)) return core_->state;
  core_->incoming = datagram;
  if (core_->state == State::Shaking) core_->shake();
  core_->drain(deliver);
  core_->incoming = {};
  return core_->state;
}

State DatagramChannel::state() const {
  return core_->state;
}

bool DatagramChannel::send(BytesView message) {
  if (core_->state != State::Open || message.empty() || message.size() > kDatagramMessageBytes)
    return false;
  ERR_clear_error();
  const int count = SSL_write(core_->ssl, message.data(), static_cast<int>(message.size()));
  if (count <= 0) core_->state = State::Failed;
  ERR_clear_error();
  return count > 0;
}

std::optional<std::chrono::microseconds> DatagramChannel::next_timeout() const {
  timeval left{};
  if (core_->state != State::Shaking || DTLSv1_get_timeout(core_->ssl, &left) != 1)
    return std::nullopt;
  return std::chrono::seconds(left.tv_sec) + std::chrono::microseconds(left.tv_usec);
}

void DatagramChannel::on_timeout() {
  ERR_clear_error();
  if (core_->state == State::Shaking && DTLSv1_handle_timeout(core_->ssl) < 0)
    core_->state = State::Failed;
  ERR_clear_error();
}

const std::array<std::uint8_t, 16>& DatagramChannel::key_id() const {
  return core_->key.id;
}

DatagramListener::DatagramListener(FindKey find_key) : find_key_(std::move(find_key)) {
  fill_random(cookie_key_);
}
DatagramListener::~DatagramListener() = default;

std::unique_ptr<DatagramChannel> DatagramListener::receive(BytesView datagram,
                                                           const std::string& peer,
                                                           const DatagramChannel::Send& send) {
  if (!waiting_) {
    waiting_ = make_core({});
    waiting_->find_key = &find_key_;
    waiting_->cookie_key = &cookie_key_;
    SSL_set_accept_state(waiting_->ssl);
  }
  waiting_->send = send;
  waiting_->peer = peer;
  waiting_->incoming = datagram;
  ERR_clear_error();
  auto* address = BIO_ADDR_new();  // stays empty: the cookie is made of `peer`
  const int heard = DTLSv1_listen(waiting_->ssl, address);
  BIO_ADDR_free(address);
  waiting_->incoming = {};
  ERR_clear_error();
  if (heard == 0) return nullptr;
  auto core = std::move(waiting_);
  if (heard < 0) return nullptr;
  core->shake();
  return std::unique_ptr<DatagramChannel>(new DatagramChannel(std::move(core)));
}

}  // namespace trocar::secure
