#include "server/session/replication/viewers.h"

#include <algorithm>

#include "proto/wire.pb.h"
#include "server/session/replication/messages.h"

namespace trocar::replication {
namespace {

Ending protocol_error(std::string text) {
  return {EndReason::ProtocolError, std::move(text)};
}

}  // namespace

Viewer::Viewer(net::Connections& connections, net::ConnectionId its_id,
               const ReplicatorOptions& options, ReplicatorCounters& counters)
    : id(its_id),
      carrier(connections.carrier_of(its_id)),
      feed(connections, its_id, options, counters),
      messages(options.max_messages_per_second, options.clock_ns()),
      bytes(options.max_bytes_per_second, options.clock_ns()) {}

Viewers::Viewers(net::Connections& connections, ViewerHost& host, const ReplicatorOptions& options,
                 ReplicatorCounters& counters)
    : connections_(connections), host_(host), options_(options), counters_(counters) {}

// ---- who is here ----

Viewer* Viewers::find(net::ConnectionId id) const {
  const auto found = viewers_.find(id);
  return found == viewers_.end() ? nullptr : found->second.get();
}

std::size_t Viewers::welcome_count() const {
  return static_cast<std::size_t>(
      std::ranges::count_if(viewers_, [](const auto& one) { return one.second->is_welcome; }));
}

void Viewers::on_open(net::ConnectionId id) {
  viewers_.emplace(id, std::make_unique<Viewer>(connections_, id, options_, counters_));
}

// Nobody is told anything more once he goes, so that he is taken out first.
std::unique_ptr<Viewer> Viewers::take_out(net::ConnectionId id) {
  auto node = viewers_.extract(id);
  return node ? std::move(node.mapped()) : nullptr;
}

void Viewers::on_close(net::ConnectionId id) {
  const auto who = take_out(id);
  if (!who) return;
  if (!host_.keep(*who)) host_.forget(*who, nullptr);
  host_.settle();
}

void Viewers::on_fault(net::ConnectionId id, net::ConnectionFault fault) {
  const auto* who = find(id);
  if (who == nullptr) return connections_.close(id);
  const bool is_timeout =
      fault == net::ConnectionFault::HelloTimeout || fault == net::ConnectionFault::IdleTimeout;
  const Ending ending{is_timeout ? EndReason::Timeout : EndReason::ProtocolError,
                      net::describe(fault)};
  if (is_timeout && host_.keep(*who)) {
    take_out(id);
    connections_.close_after_flush(id, encode_goodbye(ending.reason, ending.text));
  } else {
    end(id, ending);
  }
  host_.settle();
}

void Viewers::end(net::ConnectionId id, const Ending& ending) {
  const auto who = take_out(id);
  if (!who) return;
  ++counters_.ended[static_cast<std::size_t>(ending.reason)];
  host_.forget(*who, &ending);
  connections_.close_after_flush(id, encode_goodbye(ending.reason, ending.text));
}

void Viewers::end_slow(const std::vector<net::ConnectionId>& slow, const char* text) {
  for (const auto id : slow) end(id, {EndReason::TooSlow, text});
}

void Viewers::end_all(const Ending& ending) {
  while (!viewers_.empty()) end(viewers_.begin()->first, ending);
}

void Viewers::close(net::ConnectionId id, bool is_flushed) {
  take_out(id);
  is_flushed ? connections_.close_after_flush(id, nullptr) : connections_.close(id);
}

void Viewers::restart() {
  encoder_ = {};
  std::vector<net::ConnectionId> own;
  for (const auto& [id, who] : viewers_)
    if (who->carrier == 0) own.push_back(id);
  for (const auto id : own) connections_.close(id);
}

std::optional<Ending> Viewers::welcome(Viewer& who, const wire::SharedBytes& words,
                                       bool has_picture) {
  const Ending too_slow{EndReason::TooSlow, "the outbox is too small for the first messages"};
  who.is_welcome = true;
  if (!send(who.id, words)) return too_slow;
  auto* shown = &who;
  if (who.carrier != 0) {
    shown = find(who.carrier);
    if (std::exchange(shown->is_carrier, true)) return std::nullopt;
    shown->feed.pace();
  }
  if (has_picture && !begin(*shown)) return too_slow;
  return std::nullopt;
}

// ---- what they say ----

std::optional<Ending> Viewers::check_rate(Viewer& who, std::size_t bytes) {
  const auto now = options_.clock_ns();
  const auto flood = [this](std::uint32_t limit, const char* what) {
    ++counters_.floods;
    return protocol_error("more than " + std::to_string(limit) + " " + what +
                          " in a second: send each tool at most 250 times per second");
  };
  if (!who.messages.take(1, now)) return flood(options_.max_messages_per_second, "messages");
  if (!who.bytes.take(static_cast<double>(bytes), now))
    return flood(options_.max_bytes_per_second, "bytes");
  return std::nullopt;
}

void Viewers::on_message(net::ConnectionId id, BytesView message) {
  auto* who = find(id);
  if (who == nullptr) return;
  if (const auto ending = handle(*who, message)) end(id, *ending);
  host_.settle();
}

std::optional<Ending> Viewers::handle(Viewer& who, BytesView bytes) {
  if (auto flood = check_rate(who, bytes.size())) return flood;
  proto::Envelope message;
  if (const auto decoded = wire::decode_envelope(bytes, message); !decoded)
    return protocol_error(decoded.error().message);
  if (message.message_case() == proto::Envelope::MESSAGE_NOT_SET &&
      (who.is_welcome || who.is_carrier))
    return std::nullopt;  // of a newer minor version
  if (who.carrier != 0)
    if (auto ending = check_guest(who)) return ending;
  if (!who.is_welcome && !who.is_carrier && !message.has_hello())
    return protocol_error("the first message must be Hello");
  switch (message.message_case()) {
    case proto::Envelope::kFrameAck:
      if (who.carrier == 0) return take_ack(who, message.frame_ack());
      host_.note_shown(who, message.frame_ack());  // that the carrier was given
      return std::nullopt;
    case proto::Envelope::kKeyframeRequest:
      if (who.carrier == 0) want_keyframe(who);  // of guests the carrier asks for those it needs
      return std::nullopt;
    case proto::Envelope::kPing:
      if (answer_ping(who, message.ping().client_time_us())) return std::nullopt;
      break;
    default:
      break;
  }
  if (who.is_carrier)
    return protocol_error("a connection that carries guests says nothing else for itself");
  return host_.heed(who, message);
}

void Viewers::want_keyframe(Viewer& who) {
  who.feed.want_keyframe();
  if (who.has_begun && newest() && who.feed.is_keyframe_due()) give(who, false);
}

// A pong that does not fit is left out: the viewer measures again in a moment.
bool Viewers::answer_ping(const Viewer& who, std::uint64_t client_time_us) {
  const auto time_us = host_.server_time_us();
  if (time_us != 0)
    send(who.id, encode_pong(client_time_us, newest() ? newest()->tick : 0, time_us));
  return time_us != 0;
}

std::optional<Ending> Viewers::check_guest(const Viewer& guest) {
  const Ending closing{EndReason::ServerClosing, "the connection that carried you is closing"};
  auto* carrier = find(guest.carrier);
  if (carrier == nullptr) return closing;
  if (carrier->is_welcome)
    return protocol_error("GuestMessage: who takes part himself carries no guests");
  // Each guest begins with an allowance of its own, so that the number of guests needs one.
  if (guest.is_welcome || carrier->messages.take(1, options_.clock_ns())) return std::nullopt;
  end(carrier->id, protocol_error("GuestMessage: too many guests in a second"));
  return closing;
}

void Viewers::on_datagram(net::ConnectionId id, BytesView message) {
  auto* who = find(id);
  if (who == nullptr || !who->is_welcome) return;
  if (const auto ending = handle_datagram(*who, message)) end(id, *ending);
  host_.settle();
}

std::optional<Ending> Viewers::handle_datagram(Viewer& who, BytesView bytes) {
  if (auto flood = check_rate(who, bytes.size())) return flood;
  proto::Envelope envelope;
  if (const auto decoded = wire::decode_envelope(bytes, envelope); !decoded)
    return protocol_error(decoded.error().message);
  if (!envelope.has_client_datagram()) return std::nullopt;
  const auto& datagram = envelope.client_datagram();
  who.has_sent_datagrams = true;
  who.feed.hear(datagram.datagrams_received());
  if (auto ending = host_.heed_samples(who, datagram)) return ending;
  return datagram.has_ack() ? take_ack(who, datagram.ack()) : std::nullopt;
}

std::optional<Ending> Viewers::take_ack(Viewer& who, const proto::FrameAck& ack) {
  const Frame frame = ack.frame();
  if (!who.feed.was_given(frame))
    return protocol_error("FrameAck.frame: " + std::to_string(frame) + " was not given to you yet");
  who.feed.acknowledge(encoder_, frame);
  who.fine_parts.on_acknowledged(frame);
  host_.note_shown(who, ack);
  return std::nullopt;
}

// ---- what they are told ----

bool Viewers::send(net::ConnectionId to, const wire::SharedBytes& bytes) {
  if (!connections_.send(to, bytes)) return false;
  counters_.bytes_queued += bytes->size();
  return true;
}

// Whoever ends may be the reason for a message to all: nobody does before all have been told.
void Viewers::broadcast(const wire::SharedBytes& bytes) {
  std::vector<net::ConnectionId> slow;
  for (const auto& [id, who] : viewers_)
    if (who->listens() && !send(id, bytes)) slow.push_back(id);
  end_slow(slow, "your connection is too slow: messages that cannot be skipped piled up");
}

void Viewers::offer(const wire::SharedBytes& bytes, net::ConnectionId but) {
  for (const auto& [id, who] : viewers_)
    if (who->listens() && id != but) send(id, bytes);
}

void Viewers::give_beside(net::ConnectionId to, const wire::SharedBytes& message) {
  if (auto* who = find(to)) who->feed.give_beside(encoder_, message);
}

// ---- what they are shown ----

void Viewers::change_surface(std::uint32_t epoch, const wire::SharedBytes& framed) {
  ++counters_.surface_changes;
  counters_.surface_change_bytes += framed->size();
  encoder_.add_change(epoch, framed);
  broadcast(framed);
}

void Viewers::replace_surface(const wire::SharedBytes& topology, Frame first_useful) {
  encoder_.forget_changes();
  broadcast(topology);
  for (const auto& [id, who] : viewers_) who->feed.forget_before(first_useful);
}

void Viewers::set_frame(step::SharedFrame frame, std::uint64_t server_time_us,
                        wire::SharedBytes state) {
  encoder_.set_current(std::move(frame), server_time_us, std::move(state));
}

void Viewers::begin_fine_parts(std::size_t all) {
  for (const auto& [id, who] : viewers_)
    if (who->fine_parts.next() < all) who->fine_parts.begin();
}

bool Viewers::begin(Viewer& who) {
  who.has_begun = true;
  return host_.show(who) && (!newest() || give(who, true));
}

bool Viewers::give(Viewer& who, bool is_required) {
  const bool is_lost = who.feed.is_keyframe_due() && newest()->epoch > 0;
  if (is_lost && !send(who.id, host_.topology())) return false;
  return who.feed.give(encoder_, is_required);
}

// Frames may come as datagrams, which overtake the stream. Then only the bytes that are still to be
// acknowledged tell whether a part has arrived: none is added to a queue of them.
void Viewers::give_fine_part(Viewer& who) {
  auto& parts = who.fine_parts;
  const auto& all = host_.fine_parts();
  const Frame frame = newest()->frame;
  if (parts.next() >= all.size() || !parts.may_send(frame)) return;
  // The newest frame may still be there, but no queue.
  const auto limit = std::max(options_.skip_above_bytes / 4, 2 * encoder_.typical_frame_bytes());
  if (connections_.outstanding_bytes(who.id) > limit) return;
  if (send(who.id, all[parts.next()])) parts.on_sent(frame);  // or the next time
}

void Viewers::give_all() {
  if (!newest()) return;
  std::vector<net::ConnectionId> slow;
  for (const auto& [id, who] : viewers_) {
    if (who->listens()) {
      give(*who, false);
      give_fine_part(*who);
    } else if (who->is_shown() && !begin(*who)) {
      slow.push_back(id);
    }
  }
  end_slow(slow, "the outbox is too small for the first messages");
}

void Viewers::give_last(const wire::SharedBytes& barrier) {
  std::vector<net::ConnectionId> slow;
  for (const auto& [id, who] : viewers_)
    if (who->listens() && (!give(*who, true) || !send(id, barrier))) slow.push_back(id);
  end_slow(slow, "your connection is too slow for the last frame");
}

}  // namespace trocar::replication
