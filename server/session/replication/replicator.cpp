#include "server/session/replication/replicator.h"

#include <algorithm>
#include <cstdlib>
#include <limits>

#include "common/base/log.h"
#include "proto/wire.pb.h"
#include "server/session/access/try_limiter.h"
#include "server/session/replication/frame_feed.h"
#include "server/session/replication/messages.h"
#include "server/session/replication/replicator_client.h"

namespace trocar::replication {
namespace {

constexpr std::uint64_t kSecondNs = 1'000'000'000;
constexpr int kMostSamplesPerDatagram = 3 * kToolsPerHand;

std::string text_of_role(participants::Role role) {
  return participants::name_of(role);
}

EndReason reason_of(participants::JoinRefusal refusal, participants::Role role) {
  switch (refusal) {
    case participants::JoinRefusal::NameInvalid:
      return EndReason::NameInvalid;
    case participants::JoinRefusal::NameTaken:
      return EndReason::NameTaken;
    case participants::JoinRefusal::Full:
      return EndReason::Full;
    case participants::JoinRefusal::ToolsInvalid:
      return participants::has_tools(role) ? EndReason::ProtocolError : EndReason::Role;
  }
  return EndReason::Unspecified;
}

EndReason reason_of(access::RefusalKind refusal) {
  switch (refusal) {
    case access::RefusalKind::WrongCode:
      return EndReason::CodeWrong;
    case access::RefusalKind::Expired:
      return EndReason::CodeExpired;
    case access::RefusalKind::UsedUp:
      return EndReason::CodeUsedUp;
    case access::RefusalKind::Revoked:
      return EndReason::CodeRevoked;
    case access::RefusalKind::TooManyTries:
      return EndReason::TooManyTries;
    case access::RefusalKind::RoleNotAllowed:
      return EndReason::CodeRole;
  }
  return EndReason::Unspecified;
}

}  // namespace

Replicator::Replicator(net::Connections& connections, participants::SimulationInbox& inbox,
                       wire::SurfaceLayout layout, std::string organ_name, std::uint64_t organ_hash,
                       ReplicatorOptions options)
    : connections_(connections),
      inbox_(inbox),
      options_(std::move(options)),
      organ_hash_(organ_hash),
      organ_name_(std::move(organ_name)),
      layout_(std::move(layout)),
      roster_(options_.places),
      absences_(options_.return_seconds),
      session_{options_, *this, roster_, inbox_},
      hands_(session_, counters_),
      marks_(session_),
      pace_(session_, hands_.held()),
      drawing_(session_),
      course_(session_),
      teaching_(session_, door_, hands_, pace_, drawing_) {}

Replicator::~Replicator() = default;

// ---- who is here ----

void Replicator::on_open(net::ConnectionId id) {
  clients_.emplace(id, std::make_unique<Client>(connections_, id, options_, counters_));
}

void Replicator::on_close(net::ConnectionId id) {
  const auto found = clients_.find(id);
  if (found == clients_.end()) return;
  if (keep_place(*found->second)) return settle_participants();
  if (const auto& participant = found->second->participant)
    log::info("{} ({}) is gone", participant->name, text_of_role(participant->role));
  forget(*found->second);
  settle_participants();
}

void Replicator::on_fault(net::ConnectionId id, net::ConnectionFault fault) {
  const auto found = clients_.find(id);
  if (found == clients_.end()) return connections_.close(id);
  const bool is_timeout =
      fault == net::ConnectionFault::HelloTimeout || fault == net::ConnectionFault::IdleTimeout;
  const Ending ending{is_timeout ? EndReason::Timeout : EndReason::ProtocolError,
                      net::describe(fault)};
  if (is_timeout && keep_place(*found->second))
    connections_.close_after_flush(id, encode_goodbye(ending.reason, ending.text));
  else
    end_session(*found->second, ending);
  settle_participants();
}

void Replicator::on_message(net::ConnectionId id, BytesView message) {
  const auto found = clients_.find(id);
  if (found == clients_.end()) return;
  auto& client = *found->second;
  if (const auto ending = handle_message(client, message)) end_session(client, *ending);
  settle_participants();
}

void Replicator::end_session(Client& client, const Ending& ending) {
  const std::string who =
      client.participant ? client.participant->name : "connection " + std::to_string(client.id);
  // The gate bounds how many lines refusals make.
  const bool is_refused =
      options_.gate && !client.is_welcome && ending.reason != EndReason::ServerClosing;
  if (ending.reason == EndReason::ServerClosing)
    log::debug("{}: {}", who, ending.text);
  else if (is_refused)
    refuse(client, ending.text);
  else
    log::warn("session of {} ended: {}", who, ending.text);
  ++counters_.ended[static_cast<std::size_t>(ending.reason)];
  const auto id = client.id;
  forget(client);
  connections_.close_after_flush(id, encode_goodbye(ending.reason, ending.text));
}

void Replicator::refuse(Client& client, const std::string& reason) {
  if (client.applicant.address.empty())
    client.applicant.address = connections_.peer_address(client.id);
  options_.gate->note_refusal(client.applicant, reason);
}

void Replicator::leave(Client& client) {
  if (options_.gate && client.is_welcome) options_.gate->note_leave(client.applicant);
  if (client.participant) {
    const auto slot = client.participant->slot;
    roster_.leave(slot);
    absences_.forget(slot);
    hands_.held().forget(slot);
    if (slot.has_tools()) inbox_.push_leave(slot);
    if (wire::rights_of(client.participant->role).may_teach) teaching_.release_unless_led();
    session_.has_changed = true;
  }
}

void Replicator::forget(Client& client) {
  leave(client);
  clients_.erase(client.id);
}

void Replicator::settle_participants() {
  const auto now = options_.clock_ns();
  do {  // somebody may drop out while being told
    if (session_.has_changed) {
      session_.has_changed = false;
      session_.is_told = false;
      if (options_.on_participants) options_.on_participants(roster_.list(), newest_tick());
    }
    tell_participants(now);
  } while (session_.has_changed);
}

void Replicator::tell_participants(std::uint64_t now_ns) {
  const bool is_early =
      participants_told_ns_ && now_ns - *participants_told_ns_ < options_.participants_interval_ns;
  if (session_.is_told || is_early) return;
  session_.is_told = true;
  participants_told_ns_ = now_ns;
  broadcast(encode_participants(roster_.list(), door_.is_closed(), door_.waiting()));
}

void Replicator::end_all(EndReason reason, const std::string& text) {
  while (!clients_.empty()) end_session(*clients_.begin()->second, {reason, text});
  end_absences(std::numeric_limits<std::uint64_t>::max());
  session_.has_changed = false;
}

// ---- what they say ----

std::optional<Ending> Replicator::check_rate(Client& client, std::size_t bytes) {
  const auto now = options_.clock_ns();
  const auto flood = [this](std::uint32_t limit, const char* what) {
    ++counters_.floods;
    return Ending{EndReason::ProtocolError,
                  "more than " + std::to_string(limit) + " " + what +
                      " in a second: send each tool at most 250 times per second"};
  };
  if (!client.messages.take(1, now)) return flood(options_.max_messages_per_second, "messages");
  if (!client.bytes.take(static_cast<double>(bytes), now))
    return flood(options_.max_bytes_per_second, "bytes");
  return std::nullopt;
}

std::optional<Ending> Replicator::handle_message(Client& client, BytesView bytes) {
  const auto protocol_error = [](std::string text) {
    return Ending{EndReason::ProtocolError, std::move(text)};
  };
  if (auto flood = check_rate(client, bytes.size())) return flood;
  proto::Envelope envelope;
  if (const auto decoded = wire::decode_envelope(bytes, envelope); !decoded)
    return protocol_error(decoded.error().message);
  if (client.is_carrier) return handle_carrier(client, envelope);
  if (client.carrier != 0)
    if (auto ending = check_guest(client, envelope)) return ending;
  if (!client.participant && !envelope.has_hello())
    return protocol_error("the first message must be Hello");

  switch (envelope.message_case()) {
    case proto::Envelope::kHello:
      return admit(client, envelope.hello());
    case proto::Envelope::kToolSample:
      return hands_.sample(client, envelope.tool_sample(), !client.has_sent_datagrams);
    case proto::Envelope::kToolChange:
      return hands_.change_tool(client, envelope.tool_change());
    case proto::Envelope::kHandReport:
      return hands_.report(client, envelope.hand_report());
    case proto::Envelope::kFrameAck:
      if (client.carrier == 0) return handle_ack(client, envelope.frame_ack());
      note_answer(client.participant->slot, envelope.frame_ack());
      return std::nullopt;
    case proto::Envelope::kMarkRequest:
      return marks_.ask(client, envelope.mark_request(), pace_.is_paused());
    case proto::Envelope::kPointRequest:
      return drawing_.point(client, envelope.point_request());
    case proto::Envelope::kStrokeRequest:
      return drawing_.stroke(client, envelope.stroke_request(), layout_);
    case proto::Envelope::kViewRequest:
      return drawing_.view(client, envelope.view_request());
    case proto::Envelope::kLessonRequest:
      return course_.ask(client, envelope.lesson_request(), layout_);
    case proto::Envelope::kTeachRequest:
      return teaching_.order(client, envelope.teach_request());
    case proto::Envelope::kKeyframeRequest:
      if (client.carrier != 0) return std::nullopt;  // the carrier asks for those that it needs
      client.feed.want_keyframe();
      if (encoder_.current() && client.feed.is_keyframe_due()) give_frame(client, false);
      return std::nullopt;
    case proto::Envelope::kRelayReport:
      return handle_relay_report(client, envelope.relay_report());
    case proto::Envelope::kPing: {
      // A pong that does not fit is left out: the client measures again in a moment.
      send(client, encode_pong(envelope.ping().client_time_us(), newest_tick(),
                               options_.clock_ns() / 1000));
      return std::nullopt;
    }
    case proto::Envelope::kBye: {
      log::info("{} ({}) left", client.participant->name, text_of_role(client.participant->role));
      const auto id = client.id;
      forget(client);
      connections_.close_after_flush(id, nullptr);
      return std::nullopt;
    }
    case proto::Envelope::MESSAGE_NOT_SET:
      return std::nullopt;  // a message of a newer minor version (decode_envelope knows)
    default:
      return protocol_error("a message that only the server may send");
  }
}

void Replicator::on_datagram(net::ConnectionId id, BytesView message) {
  const auto found = clients_.find(id);
  if (found == clients_.end() || !found->second->participant) return;
  auto& client = *found->second;
  proto::Envelope envelope;
  auto ending = check_rate(client, message.size());
  if (!ending) {
    if (const auto decoded = wire::decode_envelope(message, envelope); !decoded)
      ending = Ending{EndReason::ProtocolError, decoded.error().message};
    else if (envelope.has_client_datagram())
      ending = handle_datagram(client, envelope.client_datagram());
  }
  if (ending) end_session(client, *ending);
  settle_participants();
}

std::optional<Ending> Replicator::handle_datagram(Client& client,
                                                  const proto::ClientDatagram& datagram) {
  client.has_sent_datagrams = true;
  client.feed.hear(datagram.datagrams_received());
  if (datagram.sample_size() > kMostSamplesPerDatagram)
    return Ending{EndReason::ProtocolError,
                  "ClientDatagram.sample: " + std::to_string(datagram.sample_size()) +
                      " samples, at most " + std::to_string(kMostSamplesPerDatagram)};
  for (const auto& sample : datagram.sample())
    if (auto ending = hands_.sample(client, sample, false)) return ending;
  if (!datagram.has_ack()) return std::nullopt;
  return handle_ack(client, datagram.ack());
}

std::optional<Ending> Replicator::admit(Client& client, const proto::Hello& hello) {
  if (client.participant) return Ending{EndReason::ProtocolError, "Hello: once is enough"};
  if (barrier_) return Ending{EndReason::ServerClosing, "the session is ending"};
  auto reason = EndReason::ProtocolError;
  auto request = check_hello(hello, reason);
  if (!request) return Ending{reason, request.error().message};
  if (request->acks_every_frame) client.feed.pace();
  end_absences(options_.clock_ns());
  auto* gate = options_.gate;
  client.applicant = {connections_.peer_address(client.id), request->name, request->role};
  client.applicant.relays = request->relays;
  if (const auto* place = find_own_place(*request)) return come_back(client, *place);
  if (gate) {
    const bool has_wrong_token =
        !request->return_token.empty() && roster_.find(request->name) != nullptr;
    if (const auto refusal = gate->check(client.applicant, request->join_secret, has_wrong_token))
      return Ending{reason_of(refusal->kind), refusal->text};
  }
  if (participants::is_valid_name(request->name))
    if (const auto wait = door_.check(client.applicant)) {
      session_.is_told = false;  // it is seen who waits
      return Ending{EndReason::Closed, *wait};
    }
  if (auto ending = find_place(client, *request)) return ending;
  const bool may_come = !gate || gate->admit(client.applicant);
  if (!may_come)
    return Ending{EndReason::CodeUsedUp, "join code: somebody has just taken its last use"};
  door_.note_entry(request->name);
  if (request->can_return) absences_.issue(client.participant->slot);
  ++counters_.sessions;
  log::info("{} ({}) joined as participant {}", request->name, text_of_role(request->role),
            client.participant->slot.value);
  return welcome(client);
}

std::optional<Ending> Replicator::find_place(Client& client, HelloRequest& request) {
  // Who got hold of one code does not take all places with it. A carrier's guests share its
  // address.
  const auto is_alike = [&](const Client& other) {
    return other.participant && other.carrier == 0 && other.participant->role == request.role &&
           other.applicant.code == client.applicant.code &&
           access::counted_as(other.applicant.address) ==
               access::counted_as(client.applicant.address);
  };
  const auto most_alike = participants::places_alike(request.role, options_.places);
  const bool is_bounded =
      options_.gate && client.carrier == 0 && !participants::has_tools(request.role);
  if (is_bounded && std::ranges::count_if(clients_, [&](const auto& one) {
                      return is_alike(*one.second);
                    }) >= most_alike)
    return Ending{EndReason::Full, "full: " + std::to_string(most_alike) + " " +
                                       text_of_role(request.role) +
                                       "s with this code are here from your address, come back "
                                       "later"};
  auto refusal = participants::JoinRefusal::Full;
  auto joined = roster_.join(request.name, request.role, std::move(request.tools), refusal);
  if (!joined) return Ending{reason_of(refusal, request.role), joined.error().message};
  const auto& participant = *joined;
  if (participant.slot.has_tools()) {
    hands::HandJoin join{participant.slot, static_cast<int>(participant.tools.size()), {}};
    std::copy(participant.tools.begin(), participant.tools.end(), join.shapes.begin());
    if (!inbox_.try_push_join(join)) {
      roster_.leave(participant.slot);
      return Ending{EndReason::Full, "the server is busy: try again in a second"};
    }
  }
  client.participant = participant;
  return std::nullopt;
}

std::optional<Ending> Replicator::welcome(Client& client) {
  const auto slot = client.participant->slot;
  client.is_welcome = true;
  const Ending too_slow{EndReason::TooSlow, "the outbox is too small for the first messages"};
  if (!send(client, encode_welcome(slot, organ_hash_, options_.has_datagrams, absences_.find(slot),
                                   absences_.kept_seconds())))
    return too_slow;
  if (auto ending = client.carrier == 0 ? show_all(client) : welcome_guest(client)) return ending;
  if (slot.has_tools())
    for (const auto& law : options_.haptic_laws)
      if (!send(client, encode_haptic_law(law))) return too_slow;
  // The others; the newcomer has it already, a second copy does no harm.
  session_.has_changed = true;
  return std::nullopt;
}

std::optional<Ending> Replicator::show_all(Client& client) {
  const bool is_shown =
      send(client, encode_participants(roster_.list(), door_.is_closed(), door_.waiting())) &&
      send(client, topology()) && (!encoder_.current() || give_frame(client, true)) &&
      send(client, encode_recording(recording_)) && pace_.show(client) && marks_.show(client) &&
      drawing_.show_lines(client) && course_.show(client) && drawing_.show_view(client);
  if (is_shown) return std::nullopt;
  return Ending{EndReason::TooSlow, "the outbox is too small for the first messages"};
}

std::optional<Ending> Replicator::handle_ack(Client& client, const proto::FrameAck& ack) {
  const Frame frame = ack.frame();
  if (!client.feed.was_given(frame))
    return Ending{EndReason::ProtocolError,
                  "FrameAck.frame: " + std::to_string(frame) + " was not given to you yet"};
  client.feed.acknowledge(encoder_, frame);
  client.fine_parts.on_acknowledged(frame);
  if (!client.participant) return std::nullopt;
  note_answer(client.participant->slot, ack);
  if (options_.on_followed && client.participant->slot.has_tools()) tell_followed();
  return std::nullopt;
}

void Replicator::tell_followed() {
  auto followed = std::numeric_limits<Frame>::max();
  for (const auto& who : roster_.list()) {
    if (!who.slot.has_tools()) continue;
    const auto* client = client_of(who.slot);
    followed = std::min(followed, who.is_away || !client ? 0 : client->feed.acknowledged());
  }
  options_.on_followed(followed);
}

void Replicator::note_answer(ParticipantSlot slot, const proto::FrameAck& ack) {
  if (!barrier_ || ack.frame() != barrier_->frame) return;
  for (auto& result : barrier_results_) {
    if (result.slot != slot) continue;
    result.has_answered = true;
    result.frame = ack.frame();
    result.surface_crc = ack.surface_crc();
    result.is_equal = ack.surface_crc() == barrier_->surface_crc &&
                      (barrier_->blood.empty() || ack.blood_crc() == barrier_->blood_crc);
  }
}

// ---- what they are given ----

const wire::SharedBytes& Replicator::topology() {
  if (!topology_) topology_ = encode_topology(layout_, organ_name_);
  return topology_;
}

Status Replicator::change_surface(const wire::SurfaceChange& change) {
  if (Status applied = wire::apply(change, layout_); !applied.ok()) return applied;
  const auto bytes = encode_surface_change(change, layout_, options_.clock_ns() / 1000);
  topology_.reset();
  ++counters_.surface_changes;
  counters_.surface_change_bytes += bytes->size();
  encoder_.add_change(change.epoch, bytes);
  broadcast(bytes);
  return {};
}

void Replicator::replace_surface(const wire::SurfaceLayout& layout, Frame frame) {
  layout_ = layout;
  topology_.reset();
  encoder_.forget_changes();
  broadcast(topology());
  for (const auto& [id, client] : clients_) client->feed.forget_before(frame);
}

bool Replicator::send(const Speaker& to, const wire::SharedBytes& bytes) {
  if (!connections_.send(to.id, bytes)) return false;
  counters_.bytes_queued += bytes->size();
  return true;
}

void Replicator::broadcast(const wire::SharedBytes& bytes) {
  for (auto next = clients_.begin(); next != clients_.end();) {
    auto& client = *next->second;
    ++next;  // ending a session erases it
    if (client.listens() && !send(client, bytes))
      end_session(client,
                  {EndReason::TooSlow,
                   "your connection is too slow: messages that cannot be skipped piled up"});
  }
}

void Replicator::offer(const wire::SharedBytes& bytes, const Speaker* but) {
  for (const auto& [id, client] : clients_)
    if (client->listens() && client.get() != but) send(*client, bytes);
}

Speaker* Replicator::find(ParticipantSlot slot) const {
  return client_of(slot);
}

Replicator::Client* Replicator::client_of(ParticipantSlot slot) const {
  if (const auto away = away_.find(slot); away != away_.end()) return away->second.get();
  for (const auto& [id, client] : clients_)
    if (client->participant && client->participant->slot == slot) return client.get();
  return nullptr;
}

void Replicator::put_out(ParticipantSlot slot, const std::string& words) {
  auto* client = client_of(slot);
  if (client == nullptr) return;  // it was too slow for what was said of it
  if (away_.contains(slot)) {
    leave(*client);
    away_.erase(slot);
  } else {
    end_session(*client, {EndReason::PutOut, words});
  }
}

bool Replicator::give_frame(Client& client, bool is_required) {
  const bool is_lost = client.feed.is_keyframe_due() && encoder_.current()->epoch > 0;
  if (is_lost && !send(client, topology())) return false;
  return client.feed.give(encoder_, is_required);
}

void Replicator::give_touch(Client& client) {
  const auto bytes = encode_touch(*encoder_.current(), client.participant->slot);
  if (bytes) client.feed.give_beside(encoder_, bytes);
}

void Replicator::publish(std::span<const step::SharedFrame> frames) {
  if (frames.empty()) return;
  TROCAR_ASSERT(!barrier_);
  end_absences(options_.clock_ns());
  put_out_revoked();
  Status followed;
  for (const auto& frame : frames) {
    for (const auto& event : frame->mark_events) marks_.note(event);
    if (frame->new_layout) replace_surface(*frame->new_layout, frame->frame);
    for (const auto& event : frame->claim_events) broadcast(encode_claim_event(event, roster_));
    if (frame->change && followed.ok()) followed = change_surface(*frame->change);
    if (followed.ok()) course_.observe(*frame, layout_);
  }
  const auto& newest = *frames.back();
  if (newest.epoch != layout_.epoch || newest.surface.size() != layout_.vertex_count()) {
    // Nothing that is sent from here on could be understood.
    log::error("frame {}: no way to epoch {} of the surface; {}", newest.frame, newest.epoch,
               followed.ok() ? "a change is missing" : followed.error().message);
    return end_all(EndReason::Unspecified, "the server lost track of the surface: start it again");
  }
  counters_.frames_published += frames.size();
  counters_.frames_conflated += frames.size() - 1;
  encoder_.set_current(frames.back(), options_.clock_ns() / 1000);
  for (const auto& [id, client] : clients_) {
    if (!client->listens()) continue;
    if (client->participant) give_touch(*client);
    give_frame(*client, false);
    give_fine_surface(*client);
  }
  settle_participants();
}

void Replicator::attend() {
  end_absences(options_.clock_ns());
  put_out_revoked();
  if (encoder_.current() && !barrier_)
    for (const auto& [id, client] : clients_)
      if (client->listens()) {
        give_frame(*client, false);
        give_fine_surface(*client);
      }
  settle_participants();
}

void Replicator::set_recording(const wire::RecordingState& state) {
  if (state == recording_) return;
  const auto now = options_.clock_ns();
  if (state.status == recording_.status && now - recording_told_ns_ < kSecondNs) return;
  if (state.is_damaged() && state.status != recording_.status) log::error("{}", state.text);
  recording_ = state;
  recording_told_ns_ = now;
  broadcast(encode_recording(recording_));
  settle_participants();
}

void Replicator::begin_barrier(const step::SharedFrame& last) {
  if (encoder_.current() != last) publish({&last, 1});
  barrier_ = last;
  for (const auto& participant : roster_.list())
    if (!participant.is_away)
      barrier_results_.push_back({participant.slot, participant.name, participant.role});
  const auto barrier = encode_barrier(*last);
  for (auto next = clients_.begin(); next != clients_.end();) {
    auto& client = *next->second;
    ++next;
    if (!client.listens()) continue;
    if (!give_frame(client, true) || !send(client, barrier))
      end_session(client, {EndReason::TooSlow, "your connection is too slow for the last frame"});
  }
}

bool Replicator::is_barrier_complete() const {
  return std::all_of(barrier_results_.begin(), barrier_results_.end(), [this](const auto& result) {
    return result.has_answered || roster_.find(result.slot) == nullptr;
  });
}

std::vector<BarrierResult> Replicator::barrier_results() const {
  return barrier_results_;
}

}  // namespace trocar::replication
