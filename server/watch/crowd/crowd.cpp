#include "server/watch/crowd/crowd.h"

#include "common/base/ids.h"
#include "common/base/log.h"
#include "common/secure/digest.h"
#include "proto/wire.pb.h"
#include "server/session/participants/roster.h"

namespace trocar::crowd {
namespace {

using replication::EndReason;

constexpr std::uint64_t kReportIntervalNs = 1'100'000'000;  // the server takes one in a second
constexpr std::size_t kTokenBytes = 16;
constexpr const char* kOnlyWatching =
    "you watch through a relay, which shows pictures and nothing else: join the server for more";

}  // namespace

// A copy of the limits and of how to speak to the server is for the show.
Crowd::Crowd(net::Connections& connections, CrowdOptions options)
    : Show(connections, options.limits, frame_counters_, options.say_up),
      connections_(connections),
      options_(std::move(options)) {}

Crowd::~Crowd() = default;

// ---- from the server ----

void Crowd::begin(const proto::Welcome& welcome) {
  const bool is_other = welcome_ && welcome_->organ_hash() != welcome.organ_hash();
  std::string token = welcome_ ? welcome_->return_token() : std::string(kTokenBytes, '\0');
  if (!welcome_) secure::fill_random({reinterpret_cast<std::uint8_t*>(token.data()), token.size()});
  welcome_ = std::make_unique<proto::Welcome>(welcome);
  welcome_->set_participant(ParticipantSlot{}.value);  // in no list
  welcome_->set_has_datagrams(options_.has_datagrams);
  // Whoever comes back brings the code, too: the token only says that there is a way back.
  welcome_->set_return_token(token);
  welcome_->set_return_seconds(options_.return_seconds);
  welcome_->clear_further_address();
  for (const auto& address : options_.further_addresses) welcome_->add_further_address(address);
  begin_anew();
  if (reported_ != 0) reported_.reset();
  if (is_other) restart();
}

void Crowd::note_lost() {
  proto::Envelope envelope;
  auto& event = *envelope.mutable_teach_event();
  event.set_is_done(true);
  event.set_is_trouble(true);
  event.set_text("the relay has lost the server: the picture stands still until it is back");
  viewers().offer(wire::encode_envelope(envelope));
}

void Crowd::attend() {
  give_all();
  report_number();
}

void Crowd::report_number() {
  const auto now = limits().clock_ns();
  const auto watchers = watcher_count();
  if (!has_frame_since_begin() || watchers == reported_ || now - reported_ns_ < kReportIntervalNs)
    return;
  reported_ = watchers;
  reported_ns_ = now;
  log::info("{} watchers here", watchers);
  proto::Envelope envelope;
  envelope.mutable_relay_report()->set_watchers(static_cast<std::uint32_t>(watchers));
  say_up(envelope);
}

void Crowd::restart() {
  if (viewers().connection_count() > 0) {
    ++counters_.restarts;
    log::info("the session goes on from an earlier frame: {} watchers begin anew", watcher_count());
  }
  Show::restart();
}

void Crowd::end_all(EndReason reason, const std::string& text) {
  viewers().end_all({reason, text});
}

// ---- who comes and goes ----

void Crowd::forget(const Viewer& who, const Ending* ending) {
  if (!ending || ending->reason == EndReason::ServerClosing) return;
  log::debug("connection {} ended: {}", who.id, ending->text);
  ++(who.is_welcome ? counters_.ended : counters_.refused);
}

std::optional<Crowd::Ending> Crowd::check_code(const Viewer& who, BytesView secret) {
  const auto address = connections_.peer_address(who.id);
  const auto now = limits().clock_ns();
  if (secret.empty())
    return Ending{EndReason::CodeWrong,
                  "join code: this session wants one, give --join CODE as the relay printed it"};
  if (const auto wait = limiter_.seconds_to_wait(address, now); wait > 0)
    return Ending{EndReason::TooManyTries,
                  "join code: too many wrong codes, try again in " + std::to_string(wait) + " s"};
  if (secure::equal_in_constant_time(secret, options_.secret)) return std::nullopt;
  ++counters_.wrong_codes;
  limiter_.record_wrong_try(address, now);
  return Ending{EndReason::CodeWrong,
                "join code: this relay knows no such code, check the last eight characters"};
}

std::optional<Crowd::Ending> Crowd::admit(Viewer& who, const proto::Hello& hello) {
  if (who.is_welcome) return Ending{EndReason::ProtocolError, "Hello: once is enough"};
  if (copy().last_frame()) return Ending{EndReason::ServerClosing, "the session is ending"};
  auto reason = EndReason::ProtocolError;
  const auto request = replication::check_hello(hello, reason);
  if (!request) return Ending{reason, request.error().message};
  if (auto wrong = check_code(who, request->join_secret)) return wrong;
  if (request->role != participants::Role::Observer)
    return Ending{EndReason::Role, std::string("role: a relay lets observers in, and no ") +
                                       participants::name_of(request->role) +
                                       ": join the server itself"};
  if (!participants::is_valid_name(request->name))
    return Ending{EndReason::NameInvalid, participants::kNameRule};
  if (watcher_count() >= options_.most_watchers)
    return Ending{EndReason::Full, "full: all " + std::to_string(options_.most_watchers) +
                                       " seats of this relay are taken"};
  if (request->acks_every_frame) who.feed.pace();
  ++counters_.joins;
  proto::Envelope welcome;
  *welcome.mutable_welcome() = *welcome_;
  return viewers().welcome(who, wire::encode_envelope(welcome), has_picture());
}

// ---- what they say ----

std::optional<Crowd::Ending> Crowd::heed(Viewer& who, const proto::Envelope& message) {
  switch (message.message_case()) {
    case proto::Envelope::kHello:
      return admit(who, message.hello());
    case proto::Envelope::kBye:
      viewers().close(who.id, true);
      return std::nullopt;
    case proto::Envelope::kTeachRequest:
      refuse_order(who, message.teach_request().action());
      return std::nullopt;
    case proto::Envelope::kPing:         // the server's clock is not known yet
    case proto::Envelope::kRelayReport:  // a relay of this relay: its watchers are its own business
      return std::nullopt;
    default:
      return Ending{EndReason::Role, kOnlyWatching};
  }
}

std::optional<Crowd::Ending> Crowd::heed_samples(const Viewer&,
                                                 const proto::ClientDatagram& datagram) {
  if (datagram.sample_size() > 0) return Ending{EndReason::Role, kOnlyWatching};
  return std::nullopt;
}

void Crowd::refuse_order(const Viewer& who, int action) {
  proto::Envelope answer;
  auto& event = *answer.mutable_teach_event();
  event.set_tick(copy().newest() ? copy().newest()->tick : 0);
  event.set_action(static_cast<proto::TeachAction>(action));
  event.set_text(kOnlyWatching);
  viewers().send(who.id, wire::encode_envelope(answer));
}

void Crowd::note_shown(const Viewer& who, const proto::FrameAck& ack) {
  if (!who.is_welcome || copy().last_frame() != ack.frame() || !copy().has_frame()) return;
  ++counters_.answers;
  counters_.equal_answers += ack.surface_crc() == copy().newest()->surface_crc;
}

std::uint64_t Crowd::server_time_us() const {
  return options_.server_time_us(limits().clock_ns() / 1000);
}

}  // namespace trocar::crowd
