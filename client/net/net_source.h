#pragma once

// A live server as a source of messages: TCP, TLS, handshake, pings, datagrams, on a thread of its
// own.
//
//   Asio thread                                             render thread
//   connect (retry until the deadline), TLS, check of the certificate, Hello
//   read frame -> decode -> inbound queue [256 messages] --> poll(sink)
//   write <---------------- outbound queue [256 messages] <-- send(envelope)
//   what hands feel ------------> HandLine (hand_line.h) -> the hands' loops
//   write, or as datagrams <----- HandLine, asked every 4 ms
//   Ping every 200 ms, Pong -> round trip, the server's clock
//   datagram path (datagram_path.h): slices of frames in, samples and acknowledgements out
//
// A connection that breaks, or is silent for 3 s, is made again: the source is Away meanwhile. It
// tries for as long as the server keeps the place, and comes back with the token of Welcome, here
// or at another address that Welcome has named, with the same certificate. One of those that says
// no is left out, and the next is tried. Then Welcome, topology and keyframe come anew.
//
// Inbound queue full, by messages or by bytes: nothing is read until there is room, so TCP holds
// the server back and the server skips frames for us; nothing is dropped and nothing grows.
// Outbound queue full: send() says false. Readings of hands pass both queues: while the stream
// takes nothing, the newest of each tool waits. Text from the server is made printable before
// anybody sees it. state() changes inside poll() only, so call poll() also while connecting. See
// session_source.h for what each member promises.

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "client/replica/hand_line.h"
#include "client/replica/session_source.h"
#include "common/base/result.h"
#include "common/secure/join_code.h"
#include "common/secure/tls.h"
#include "common/tool/tool.h"

namespace trocar::net {

struct NetSourceOptions {
  std::string host = "127.0.0.1";  // address or name
  std::uint16_t port = 7690;
  std::string participant_name;
  int role = 1;                        // proto::Role
  std::vector<tool::ToolShape> tools;  // empty: one default tool for roles that have tools
  secure::TlsContext tls;              // null: without TLS
  // With TLS, asked once the handshake is done: whose certificate it must be, and what is sent with
  // Hello. Empty: nothing is compared and nothing is sent.
  std::function<Result<secure::JoinCode>()> join_code;
  bool wants_datagrams = true;  // where the server has them
  // Hands that feel, or null. It outlives the source, and is called on the Asio thread.
  replica::HandLine* hands = nullptr;
  // Whoever polls acknowledges each frame, as a Replica does. Else the server does not pace frames.
  bool acks_every_frame = true;
  bool trusts_ca = false;  // the CA in `tls` vouches for the server, so the code need not
  std::chrono::milliseconds connect_deadline{15000};  // a server may still be starting
  std::chrono::milliseconds connect_retry{200};
  std::chrono::milliseconds ping_interval{200};
  std::chrono::milliseconds silence_deadline{10000};  // nothing from the server: lost
  bool can_return = true;                             // when the connection breaks
  std::chrono::milliseconds return_silence{3000};     // as silence_deadline, where it can return
  std::chrono::milliseconds return_try{3000};         // longest time for one try to connect
  std::size_t inbound_capacity = 256;                 // messages
  std::size_t inbound_bytes = 32 << 20;               // as they came; decoded they take more
  std::size_t outbound_capacity = 256;
  std::function<void()> before_message;  // for tests: on the Asio thread, before each is handed on
};

// Reads "HOST", "HOST:PORT" or "[IPV6]:PORT" into options.host and options.port.
Status parse_server_address(const std::string& text, NetSourceOptions& options);

class NetSource final : public replica::SessionSource {
 public:
  explicit NetSource(NetSourceOptions options);
  // Says Bye if still connected; returns within about 200 ms.
  ~NetSource() override;

  void poll(replica::MessageSink& sink) override;
  bool send(const proto::Envelope& message) override;
  void close(const std::string& reason) override;
  replica::SourceState state() const override;
  replica::CloseReason close_reason() const override;
  replica::SourceStatistics statistics() const override;
  std::string name() const override;

 private:
  class Session;  // everything the Asio thread touches

  std::unique_ptr<Session> session_;
  replica::SourceState state_ = replica::SourceState::Connecting;
};

}  // namespace trocar::net
