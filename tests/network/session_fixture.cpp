#include "tests/network/session_fixture.h"

#include "common/wire/surface_messages.h"
#include "tests/support/surface_edits.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>

#include "common/base/version.h"
#include "server/tissue/world/surface_layout.h"

namespace trocar::testing {

// ---- RawClient ----

RawClient::RawClient(std::uint16_t port, int receive_buffer_bytes)
    : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
  if (receive_buffer_bytes > 0)
    ::setsockopt(socket_, SOL_SOCKET, SO_RCVBUF, &receive_buffer_bytes,
                 sizeof receive_buffer_bytes);
  const timeval patience{10, 0};
  ::setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  ::setsockopt(socket_, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience);
  const int on = 1;
  ::setsockopt(socket_, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const auto* to = reinterpret_cast<const sockaddr*>(&address);
  EXPECT_EQ(::connect(socket_, to, sizeof address), 0);
}

RawClient::~RawClient() {
  ::close(socket_);
}

bool RawClient::send_bytes(BytesView bytes) {
  while (!bytes.empty()) {
    const auto sent = ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent <= 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(sent));
  }
  return true;
}

bool RawClient::send(const proto::Envelope& envelope) {
  return send_bytes(*wire::encode_envelope(envelope));
}

void RawClient::shut_down_sending() {
  ::shutdown(socket_, SHUT_WR);
}

bool RawClient::is_closed() const {
  char byte = 0;
  const auto count = ::recv(socket_, &byte, 1, MSG_PEEK | MSG_DONTWAIT);
  return count == 0 || (count < 0 && errno != EAGAIN);
}

bool RawClient::receive_exactly(std::uint8_t* to, std::size_t count) {
  while (count > 0) {
    const auto taken = ::recv(socket_, to, count, 0);
    if (taken <= 0) return false;
    to += taken;
    count -= static_cast<std::size_t>(taken);
  }
  return true;
}

std::optional<proto::Envelope> RawClient::receive() {
  std::array<std::uint8_t, wire::kHeaderBytes> header{};
  if (!receive_exactly(header.data(), header.size())) return std::nullopt;
  const auto length = wire::decode_length(header, wire::kMaxDownstreamBytes);
  if (!length) return std::nullopt;
  Bytes body(*length);
  if (!receive_exactly(body.data(), body.size())) return std::nullopt;
  proto::Envelope envelope;
  const auto decoded = wire::decode_envelope(body, envelope);
  EXPECT_TRUE(decoded.ok());
  return envelope;
}

std::optional<proto::Envelope> RawClient::receive(proto::Envelope::MessageCase kind) {
  while (auto message = receive())
    if (message->message_case() == kind) return message;
  return std::nullopt;
}

std::optional<proto::Goodbye> RawClient::read_goodbye() {
  std::optional<proto::Goodbye> goodbye;
  while (const auto message = receive())
    if (message->has_goodbye()) goodbye = message->goodbye();
  return goodbye;
}

bool RawClient::reads_to_end() {
  std::array<std::uint8_t, 4096> buffer{};
  ssize_t taken = 0;
  do taken = ::recv(socket_, buffer.data(), buffer.size(), 0);
  while (taken > 0);
  return taken == 0 || errno == ECONNRESET;
}

bool RawClient::join(const std::string& name, proto::Role role) {
  return send(make_hello(name, role)) && receive(proto::Envelope::kWelcome).has_value();
}

std::optional<proto::Welcome> RawClient::join_to_return(const std::string& name, proto::Role role,
                                                        const std::string& token) {
  auto hello = make_hello(name, role);
  hello.mutable_hello()->set_can_return(true);
  hello.mutable_hello()->set_return_token(token);
  if (!send(hello)) return std::nullopt;
  const auto message = receive(proto::Envelope::kWelcome);
  if (!message) return std::nullopt;
  return message->welcome();
}

void RawClient::take_layout_message(const proto::Envelope& message) {
  if (message.has_surface_topology()) {
    auto read = wire::read(message.surface_topology());
    EXPECT_TRUE(read.ok());
    layout = std::move(*read);
    ++topologies;
  } else if (message.has_surface_change() && layout) {
    const auto change = wire::read(message.surface_change(), *layout);
    EXPECT_TRUE(change.ok() && wire::apply(*change, *layout).ok());
    ++changes;
  }
}

bool RawClient::follow(Expect expect) {
  auto message = receive();
  for (; message && !message->has_surface_frame(); message = receive())
    take_layout_message(*message);
  if (!message) return false;
  const auto& update = message->surface_frame();
  if (layout) {
    EXPECT_EQ(update.epoch(), layout->epoch);
    surface.resize(layout->vertex_count());
  }
  const BytesView payload{reinterpret_cast<const std::uint8_t*>(update.payload().data()),
                          update.payload().size()};
  last_was_keyframe = update.is_keyframe();
  last_base = update.base_frame();
  EXPECT_TRUE(last_was_keyframe || last_base == frame)
      << "a delta against frame " << last_base << " for a client that has " << frame;
  const auto decoded = last_was_keyframe ? wire::decode_keyframe(payload, surface)
                                         : wire::decode_delta(payload, surface);
  EXPECT_TRUE(decoded.ok()) << (decoded.ok() ? "" : decoded.error().message);
  EXPECT_EQ(wire::surface_crc(surface) == update.surface_crc(), expect == Expect::RightCrc);
  frame = update.frame();
  ++frames_followed;
  return decoded.ok();
}

proto::Envelope make_hello(const std::string& name, proto::Role role) {
  proto::Envelope envelope;
  auto& hello = *envelope.mutable_hello();
  hello.set_protocol_major(kProtocolMajor);
  hello.set_protocol_minor(kProtocolMinor);
  hello.set_name(name);
  hello.set_role(role);
  return envelope;
}

proto::Envelope make_sample(std::uint32_t sequence) {
  proto::Envelope envelope;
  auto& sample = *envelope.mutable_tool_sample();
  sample.set_sequence(sequence);
  sample.mutable_position_m()->set_y(0.1f);
  sample.mutable_orientation()->set_w(1);
  sample.set_verb(proto::VERB_PUSH);
  return envelope;
}

// ---- LiveSession ----

LiveSession::LiveSession(net::TcpServerOptions tcp, replication::ReplicatorOptions options,
                         catalogue::LatticeSize size, std::uint16_t port)
    : organ_(*catalogue::make_lattice(size)), layout_(world::make_surface_layout(organ_)) {
  tcp.port = port;
  auto listening = net::TcpServer::listen(io_, tcp);
  EXPECT_TRUE(listening.ok());
  tcp_ = std::move(*listening);
  options.has_datagrams = tcp_->has_datagrams();
  connections_ = std::make_unique<crowd::GuestConnections>(*tcp_);
  replicator_ = std::make_unique<replication::Replicator>(*connections_, inbox, layout_,
                                                          organ_.name, 42, std::move(options));
  connections_->set_handler(replicator_->handler());
  tcp_->start(*connections_);
  port_ = tcp_->port();
  surface_.resize(layout_.vertex_count());
  thread_ = std::thread([this] { io_.run(); });
}

LiveSession::~LiveSession() {
  on_io([this] { tcp_.reset(); });
  work_.reset();
  io_.stop();
  thread_.join();
}

step::SharedFrame LiveSession::make_frame(std::size_t changes, bool is_cut) {
  auto frame = std::make_shared<step::PublishedFrame>();
  if (is_cut) {
    frame->change = std::make_shared<wire::SurfaceChange>(random_change(layout_, cuts_));
    EXPECT_TRUE(wire::apply(*frame->change, layout_).ok());
    surface_.resize(layout_.vertex_count(), {100, -50, 25});
  }
  for (std::size_t i = 0; i < changes; ++i) {
    auto& vertex = surface_[random_() % surface_.size()];
    const auto step = [this] { return static_cast<std::int32_t>(random_() % 401) - 200; };
    vertex += {step(), step(), step()};
  }
  frame->frame = ++frame_;
  frame->epoch = layout_.epoch;
  frame->tick = frame_ * kTicksPerFrame;
  frame->surface = surface_;
  frame->surface_crc = wire::surface_crc(surface_);
  frame->regions.resize(surface_.size());
  return frame;
}

step::SharedFrame LiveSession::publish(std::size_t changes, std::vector<hands::ClaimEvent> events) {
  auto frame = std::make_shared<step::PublishedFrame>(*make_frame(changes));
  frame->claim_events = std::move(events);
  const step::SharedFrame shared = std::move(frame);
  on_io([&] { replicator_->publish({&shared, 1}); });
  return shared;
}

void LiveSession::publish_all(const std::vector<step::SharedFrame>& frames) {
  on_io([&] { replicator_->publish(frames); });
}

std::size_t LiveSession::sessions() {
  return on_io([this] { return replicator_->session_count(); });
}

bool LiveSession::wait_for_sessions(std::size_t count) {
  for (int i = 0; i < 5000; ++i) {
    if (sessions() == count) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return false;
}

}  // namespace trocar::testing
