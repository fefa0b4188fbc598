#include "server/session/replication/replicator.h"

#include <algorithm>
#include <limits>

#include "common/base/log.h"
#include "proto/wire.pb.h"
#include "server/session/replication/messages.h"

namespace trocar::replication {
namespace {

constexpr std::uint64_t kSecondNs = 1'000'000'000;
constexpr int kMostSamplesPerDatagram = 3 * kToolsPerHand;

}  // namespace

Replicator::Replicator(net::Connections& connections, participants::SimulationInbox& inbox,
                       wire::SurfaceLayout layout, std::string organ_name, std::uint64_t organ_hash,
                       ReplicatorOptions options)
    : inbox_(inbox),
      options_(std::move(options)),
      organ_hash_(organ_hash),
      organ_name_(std::move(organ_name)),
      layout_(std::move(layout)),
      connections_(connections),
      roster_(options_.places),
      session_{options_, *this, roster_, inbox_},
      viewers_(connections, *this, options_, counters_),
      returns_(session_, counters_),
      admission_(session_, door_, returns_.absences()),
      hands_(session_, counters_),
      marks_(session_),
      pace_(session_, hands_.held()),
      drawing_(session_),
      course_(session_),
      teaching_(session_, door_, hands_, pace_, drawing_) {}

// ---- who is here ----

Speaker* Replicator::find(ParticipantSlot slot) const {
  if (auto* away = returns_.find(slot)) return away;
  for (const auto& [id, who] : speakers_)
    if (who->participant && who->participant->slot == slot) return who.get();
  return nullptr;
}

std::uint32_t Replicator::code_of(ParticipantSlot slot) const {
  const auto* who = find(slot);
  return who == nullptr ? 0 : who->applicant.code;
}

bool Replicator::keep(const Viewer& viewer) {
  const auto found = speakers_.find(viewer.id);
  if (found == speakers_.end() || !viewer.is_welcome || barrier_) return false;
  if (!returns_.keep(found->second)) return false;
  speakers_.erase(found);
  return true;
}

void Replicator::forget(const Viewer& viewer, const Ending* ending) {
  const auto node = speakers_.extract(viewer.id);
  const auto* who = node ? node.mapped().get() : nullptr;
  const std::string name =
      who && who->participant ? who->participant->name : "connection " + std::to_string(viewer.id);
  if (!ending) {
    if (who && who->participant) log::info("{} is gone", name);
  } else if (ending->reason == EndReason::ServerClosing) {
    log::debug("{}: {}", name, ending->text);
  } else if (options_.gate && !viewer.is_welcome) {  // it bounds how many lines refusals make
    auto applicant = who ? who->applicant : access::Applicant();
    applicant.address = connections_.peer_address(viewer.id);
    options_.gate->note_refusal(applicant, ending->text);
  } else {
    log::warn("session of {} ended: {}", name, ending->text);
  }
  if (who && who->participant) leave(*who);
}

void Replicator::leave(const Speaker& who) {
  const auto slot = who.participant->slot;
  if (options_.gate) options_.gate->note_leave(who.applicant);
  roster_.leave(slot);
  returns_.absences().forget(slot);
  hands_.held().forget(slot);
  if (slot.has_tools()) inbox_.push_leave(slot);
  if (wire::rights_of(who.participant->role).may_teach) teaching_.release_unless_led();
  session_.has_changed = true;
}

void Replicator::say_bye(const Viewer& viewer) {
  const auto node = speakers_.extract(viewer.id);
  const auto& who = *node.mapped();
  log::info("{} ({}) left", who.participant->name, participants::name_of(who.participant->role));
  viewers_.close(viewer.id, true);
  leave(who);
}

void Replicator::put_out(ParticipantSlot slot, const std::string& words) {
  if (const auto away = returns_.take(slot))
    leave(*away);
  else if (const auto* who = find(slot))  // null: it was too slow for what was said of it
    viewers_.end(who->id, {EndReason::PutOut, words});
}

void Replicator::attend_people() {
  for (const auto& who : returns_.take_expired(options_.clock_ns())) leave(*who);
  auto* gate = options_.gate;
  if (!gate || !gate->refresh()) return;
  std::vector<net::ConnectionId> revoked;
  for (const auto& [id, who] : speakers_)
    if (who->participant && gate->puts_out(who->applicant)) revoked.push_back(id);
  for (const auto id : revoked)
    viewers_.end(id, {EndReason::CodeRevoked,
                      "join code: the host has revoked the code that you came with"});
  for (const auto& who : returns_.take_revoked()) leave(*who);
}

wire::SharedBytes Replicator::participants_message() const {
  return encode_participants(roster_.list(), door_.is_closed(), door_.waiting());
}

// Those who are here are told at once, but when many come and go only every tenth of a second.
void Replicator::settle() {
  const auto now = options_.clock_ns();
  do {  // somebody may drop out while being told
    if (session_.has_changed) {
      session_.has_changed = false;
      session_.is_told = false;
      if (options_.on_participants) options_.on_participants(roster_.list(), newest_tick());
    }
    const bool is_early =
        participants_told_ns_ && now - *participants_told_ns_ < options_.participants_interval_ns;
    if (session_.is_told || is_early) continue;
    session_.is_told = true;
    participants_told_ns_ = now;
    broadcast(participants_message());
  } while (session_.has_changed);
}

void Replicator::end_all(EndReason reason, const std::string& text) {
  viewers_.end_all({reason, text});
  for (const auto& who : returns_.take_expired(std::numeric_limits<std::uint64_t>::max()))
    leave(*who);
  session_.has_changed = false;
}

// ---- who comes ----

std::optional<Ending> Replicator::heed_hello(Viewer& viewer, const proto::Hello& hello) {
  if (viewer.is_welcome) return Ending{EndReason::ProtocolError, "Hello: once is enough"};
  if (barrier_) return Ending{EndReason::ServerClosing, "the session is ending"};
  auto reason = EndReason::ProtocolError;
  auto request = check_hello(hello, reason);
  if (!request) return Ending{reason, request.error().message};
  if (request->acks_every_frame) viewer.feed.pace();
  attend_people();
  auto& who = *(speakers_[viewer.id] = std::make_unique<Speaker>(viewer.id, options_));
  who.is_guest = viewer.carrier != 0;
  who.applicant = {connections_.peer_address(viewer.id), request->name, request->role};
  who.applicant.relays = request->relays;
  if (const auto* place = returns_.find_own_place(*request))
    return come_back(viewer, who, place->slot);
  if (auto ending = admission_.admit(who, *request)) return ending;
  ++counters_.sessions;
  log::info("{} ({}) joined as participant {}", request->name, participants::name_of(request->role),
            who.participant->slot.value);
  return welcome(viewer, who);
}

std::optional<Ending> Replicator::come_back(Viewer& viewer, Speaker& who, ParticipantSlot slot) {
  // The old connection may hang without that anybody has noticed.
  auto before = returns_.take(slot);
  const bool hangs = before == nullptr;
  if (hangs) {
    before = std::move(speakers_.extract(find(slot)->id).mapped());
    viewers_.close(before->id, false);
  }
  returns_.come_back(who, *before);
  log::info("{} ({}) is back{}", who.participant->name,
            participants::name_of(who.participant->role),
            hangs ? ", the old connection still hung" : "");
  return welcome(viewer, who);
}

std::optional<Ending> Replicator::welcome(Viewer& viewer, const Speaker& who) {
  const auto slot = who.participant->slot;
  const auto& absences = returns_.absences();
  const auto words = encode_welcome(slot, organ_hash_, options_.has_datagrams, absences.find(slot),
                                    absences.kept_seconds());
  if (auto ending = viewers_.welcome(viewer, words, true)) return ending;
  if (slot.has_tools())
    for (const auto& law : options_.haptic_laws)
      if (!send(who, encode_haptic_law(law)))
        return Ending{EndReason::TooSlow, "the outbox is too small for the first messages"};
  // The others; the newcomer has it already, a second copy does no harm.
  session_.has_changed = true;
  return std::nullopt;
}

bool Replicator::show(const Viewer& viewer) {
  const Speaker newcomer(viewer.id, options_);
  return send(newcomer, participants_message()) && send(newcomer, topology()) &&
         send(newcomer, encode_recording(recording_)) && pace_.show(newcomer) &&
         marks_.show(newcomer) && drawing_.show_lines(newcomer) && course_.show(newcomer) &&
         drawing_.show_view(newcomer);
}

// ---- what they say ----

std::optional<Ending> Replicator::heed(Viewer& viewer, const proto::Envelope& message) {
  if (message.has_hello()) return heed_hello(viewer, message.hello());
  auto& who = *speakers_.at(viewer.id);
  switch (message.message_case()) {
    case proto::Envelope::kToolSample:
      return hands_.sample(who, message.tool_sample(), !viewer.has_sent_datagrams);
    case proto::Envelope::kToolChange:
      return hands_.change_tool(who, message.tool_change());
    case proto::Envelope::kHandReport:
      return hands_.report(who, message.hand_report());
    case proto::Envelope::kMarkRequest:
      return marks_.ask(who, message.mark_request(), pace_.is_paused());
    case proto::Envelope::kPointRequest:
      return drawing_.point(who, message.point_request());
    case proto::Envelope::kStrokeRequest:
      return drawing_.stroke(who, message.stroke_request(), layout_);
    case proto::Envelope::kViewRequest:
      return drawing_.view(who, message.view_request());
    case proto::Envelope::kLessonRequest:
      return course_.ask(who, message.lesson_request(), layout_);
    case proto::Envelope::kTeachRequest:
      return teaching_.order(who, message.teach_request());
    case proto::Envelope::kRelayReport:
      return heed_relay_report(who, message.relay_report());
    case proto::Envelope::kBye:
      say_bye(viewer);
      return std::nullopt;
    default:
      return Ending{EndReason::ProtocolError, "a message that only the server may send"};
  }
}

std::optional<Ending> Replicator::heed_samples(const Viewer& viewer,
                                               const proto::ClientDatagram& datagram) {
  if (datagram.sample_size() > kMostSamplesPerDatagram)
    return Ending{EndReason::ProtocolError,
                  "ClientDatagram.sample: " + std::to_string(datagram.sample_size()) +
                      " samples, at most " + std::to_string(kMostSamplesPerDatagram)};
  auto& who = *speakers_.at(viewer.id);
  for (const auto& sample : datagram.sample())
    if (auto ending = hands_.sample(who, sample, false)) return ending;
  return std::nullopt;
}

std::optional<Ending> Replicator::heed_relay_report(Speaker& who,
                                                    const proto::RelayReport& report) {
  if (who.participant->role != participants::Role::Observer)
    return Ending{EndReason::Role, std::string("RelayReport: an observer may relay, and no ") +
                                       participants::name_of(who.participant->role)};
  if (report.watchers() > wire::kMostRelayed)
    return Ending{EndReason::ProtocolError,
                  "RelayReport.watchers: " + std::to_string(report.watchers()) + ", at most " +
                      std::to_string(wire::kMostRelayed)};
  if (!who.reports.take(1, options_.clock_ns()))
    return Ending{EndReason::ProtocolError, "RelayReport: more than one in a second"};
  roster_.set_relayed(who.participant->slot, report.watchers());
  session_.is_told = false;  // the recording does not need it
  return std::nullopt;
}

void Replicator::note_shown(const Viewer& viewer, const proto::FrameAck& ack) {
  const auto found = speakers_.find(viewer.id);
  if (found == speakers_.end()) return;  // a carrier: each of its guests answers for himself
  const auto slot = found->second->participant->slot;
  if (options_.on_followed && slot.has_tools()) tell_followed();
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

void Replicator::tell_followed() {
  auto followed = std::numeric_limits<Frame>::max();
  for (const auto& one : roster_.list()) {
    if (!one.slot.has_tools()) continue;
    const auto* who = find(one.slot);
    const auto* viewer = who ? viewers_.find(who->id) : nullptr;
    followed = std::min(followed, one.is_away || !viewer ? 0 : viewer->feed.acknowledged());
  }
  options_.on_followed(followed);
}

// ---- what they are given ----

const wire::SharedBytes& Replicator::topology() {
  if (!topology_) topology_ = encode_topology(layout_, organ_name_);
  return topology_;
}

Status Replicator::change_surface(const wire::SurfaceChange& change) {
  if (Status applied = wire::apply(change, layout_); !applied.ok()) return applied;
  topology_.reset();
  viewers_.change_surface(change.epoch, encode_surface_change(change, layout_, server_time_us()));
  return {};
}

void Replicator::publish(std::span<const step::SharedFrame> frames) {
  if (frames.empty()) return;
  TROCAR_ASSERT(!barrier_);
  attend_people();
  Status followed;
  for (const auto& frame : frames) {
    for (const auto& event : frame->mark_events) marks_.note(event);
    if (frame->new_layout) {
      layout_ = *frame->new_layout;
      topology_.reset();
      viewers_.replace_surface(topology(), frame->frame);
    }
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
  viewers_.set_frame(frames.back(), server_time_us());
  for (const auto& [id, who] : speakers_)  // what its tools feel, if a hand feels them
    if (who->participant)
      if (const auto touch = encode_touch(newest, who->participant->slot))
        viewers_.give_beside(id, touch);
  viewers_.give_all();
  settle();
}

void Replicator::attend() {
  attend_people();
  if (!barrier_) viewers_.give_all();
  settle();
}

void Replicator::set_recording(const wire::RecordingState& state) {
  if (state == recording_) return;
  const auto now = options_.clock_ns();
  if (state.status == recording_.status && now - recording_told_ns_ < kSecondNs) return;
  if (state.is_damaged() && state.status != recording_.status) log::error("{}", state.text);
  recording_ = state;
  recording_told_ns_ = now;
  broadcast(encode_recording(recording_));
  settle();
}

void Replicator::begin_barrier(const step::SharedFrame& last) {
  if (newest_frame() != last) publish({&last, 1});
  barrier_ = last;
  for (const auto& participant : roster_.list())
    if (!participant.is_away)
      barrier_results_.push_back({participant.slot, participant.name, participant.role});
  viewers_.give_last(encode_barrier(*last));
}

bool Replicator::is_barrier_complete() const {
  return std::ranges::all_of(barrier_results_, [this](const auto& result) {
    return result.has_answered || roster_.find(result.slot) == nullptr;
  });
}

}  // namespace trocar::replication
