#pragma once

// One end of a DTLS 1.2 connection, over datagrams that its owner sends and receives. The key is
// exported from the TLS session of the same client (RFC 8446 section 7.5) and used as pre-shared
// key, so a datagram always belongs to one identity and the keys of two sessions are unrelated.
// OpenSSL keeps replayed datagrams out and repeats lost flights of the handshake.
//
//   client: start() -----ClientHello-----> DatagramListener: a cookie, and nothing is kept
//           receive() <--cookie----------
//           ---ClientHello with cookie---> DatagramListener returns a channel
//           <----------------------------> receive() on both sides, until Open
//
// Thread: all calls on one thread. No call blocks.

#include <array>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "common/base/bytes.h"
#include "common/secure/digest.h"

namespace trocar::secure {

struct DatagramKey {
  Digest secret{};
  std::array<std::uint8_t, 16> id{};  // names the key in the open
};

// A datagram never exceeds this, sealed; no path of today's networks cuts it up.
inline constexpr std::size_t kDatagramBytes = 1200;
// A record's header, explicit nonce and tag leave so much of it for a message.
inline constexpr std::size_t kDatagramMessageBytes = kDatagramBytes - 13 - 8 - 16;

class DatagramChannel {
 public:
  using Send = std::function<void(BytesView)>;
  using Deliver = std::function<void(BytesView)>;
  enum class State { Shaking, Open, Failed };
  struct Core;  // OpenSSL's objects

  // A client's end; start() sends the first datagram.
  static std::unique_ptr<DatagramChannel> make_client(const DatagramKey& key, Send send);
  ~DatagramChannel();

  void start();
  // Takes one datagram of the peer and hands on the messages in it. What is forged, replayed or
  // garbled is dropped, and so are alerts that nobody has sealed: a handshake that the peer gives
  // up ends by its owner's deadline.
  State receive(BytesView datagram, const Deliver& deliver);
  State state() const;
  // Seals and sends one message of at most kDatagramMessageBytes; false unless Open.
  bool send(BytesView message);
  // When on_timeout() wants to be called; nothing while there is nothing to repeat.
  std::optional<std::chrono::microseconds> next_timeout() const;
  void on_timeout();
  // The key that the peer has proved to hold, once Open (server's end).
  const std::array<std::uint8_t, 16>& key_id() const;

 private:
  friend class DatagramListener;
  explicit DatagramChannel(std::unique_ptr<Core> core);

  std::unique_ptr<Core> core_;
};

// A server's side of all addresses that it does not know. It proves an address by a cookie before
// it keeps anything, and never answers with more bytes than it was sent.
class DatagramListener {
 public:
  // Asked for the secret of a key by its id, while a handshake runs.
  using FindKey = std::function<std::optional<Digest>(const std::array<std::uint8_t, 16>& id)>;

  explicit DatagramListener(FindKey find_key);
  ~DatagramListener();

  // `peer`: its address and port as text. `send` answers to it. Returns a channel when the peer
  // has shown that it receives at this address, else null.
  std::unique_ptr<DatagramChannel> receive(BytesView datagram, const std::string& peer,
                                           const DatagramChannel::Send& send);

 private:
  FindKey find_key_;
  Digest cookie_key_;
  std::unique_ptr<DatagramChannel::Core> waiting_;  // for the next peer
};

}  // namespace trocar::secure
