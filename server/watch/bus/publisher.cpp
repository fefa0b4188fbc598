#include "server/watch/bus/publisher.h"

#include <algorithm>

#include "common/base/log.h"
#include "common/secure/digest.h"
#include "common/wire/session_messages.h"
#include "proto/wire.pb.h"
#include "server/watch/bus/piece.h"

namespace trocar::bus {
namespace {

using follow::News;
using wire::EndReason;

constexpr std::chrono::milliseconds kSignPeriod{500};
constexpr std::uint64_t kTakeOverNs = 2'000'000'000;
constexpr std::size_t kMostAnswerBytes = 8 * 1024 * 1024;  // that wait when another is begun
constexpr std::size_t kMostAskBytes = 4096;
constexpr double kMostAnswersPerSecond = 20;
constexpr std::size_t kLeastBytes = 1024;  // of a message that the bus takes
constexpr double kMostPongsPerSecond = 1000;
constexpr std::size_t kMostBytesBeforePong =
    Publisher::kBusyBytes / 2;                         // so none holds back frames
constexpr std::uint64_t kAnswerPauseNs = 250'000'000;  // from one to the next for the same asker

PublisherOptions with_id(PublisherOptions options) {
  auto& id = options.id;
  if (id == 0) secure::fill_random({reinterpret_cast<std::uint8_t*>(&id), sizeof id});
  return options;
}

// A Welcome for everybody: what was for this relay alone is left out.
wire::SharedBytes for_everybody(const proto::Welcome& welcome) {
  proto::Envelope envelope;
  auto& shown = *envelope.mutable_welcome();
  shown.set_protocol_major(welcome.protocol_major());
  shown.set_protocol_minor(welcome.protocol_minor());
  shown.set_sim_version(welcome.sim_version());
  shown.set_organ_hash(welcome.organ_hash());
  shown.set_tick_us(welcome.tick_us());
  shown.set_ticks_per_frame(welcome.ticks_per_frame());
  return wire::encode_envelope(envelope);
}

Bytes joined(const std::vector<wire::SharedBytes>& messages) {
  Bytes whole;
  for (const auto& message : messages)
    if (message) whole.insert(whole.end(), message->begin(), message->end());
  return whole;
}

}  // namespace

Publisher::Publisher(asio::any_io_executor executor, std::unique_ptr<follow::Upstream> upstream,
                     std::unique_ptr<Channel> channel, PublisherOptions options)
    : upstream_(std::move(upstream)),
      channel_(std::move(channel)),
      options_(with_id(std::move(options))),
      subjects_(options_.session),
      next_(executor),
      answers_(kMostAnswersPerSecond, options_.clock_ns()),
      pongs_(kMostPongsPerSecond, options_.clock_ns()),
      copy_(std::make_unique<follow::SessionCopy>()),
      other_ns_(options_.clock_ns()) {}

Publisher::~Publisher() = default;

Status Publisher::listen() {
  auto heard = channel_->listen(
      subjects_.stream, [this](BytesView bytes, const std::string&) { take_stream(bytes); });
  if (!heard) return heard;
  return channel_->listen(subjects_.ask, [this](BytesView bytes, const std::string& answer_to) {
    take_ask(bytes, answer_to);
  });
}

void Publisher::start(follow::UpstreamEvents events) {
  events_ = std::move(events);
  upstream_->start(
      {.welcome = [this](const auto& welcome) { take_welcome(welcome); },
       .message = [this](const auto& message, const auto& framed) { return take(message, framed); },
       .lost =
           [this](const std::string& why) {
             if (events_.lost) events_.lost(why);
           },
       .over = [this](EndReason reason, const std::string& text) { take_over(reason, text); }});
  attend_often();
}

void Publisher::stop() {
  next_.cancel();
  events_ = {};
  upstream_->stop();
}

// ---- from the server ----

void Publisher::take_welcome(const proto::Welcome& welcome) {
  copy_ = std::make_unique<follow::SessionCopy>();
  welcome_ = for_everybody(welcome);
  barrier_.reset();
  published_.reset();
  watchers_.begin_anew();
  publish({welcome_});
  if (const auto hand_on = events_.welcome) hand_on(welcome);
}

Status Publisher::take(const proto::Envelope& message, const wire::SharedBytes& framed) {
  pass_on(message, framed);
  const auto hand_on = events_.message;  // a copy: it may stop this
  return hand_on ? hand_on(message, framed) : Status();
}

void Publisher::take_over(EndReason reason, const std::string& text) {
  // A relay that is put out, or for a reason that it does not know, says nothing of the others.
  if (reason == EndReason::ServerClosing && was_active_) {
    goodbye_ = wire::encode_goodbye(reason, text);
    publish({goodbye_});
  }
  next_.cancel();
  if (const auto over = std::exchange(events_, {}).over) over(reason, text);
}

// A message that is wrong is left out: the relay finds that as well, and begins anew.
void Publisher::pass_on(const proto::Envelope& message, const wire::SharedBytes& framed) {
  const auto news = copy_->take(message, framed);
  if (!news) return;
  switch (*news) {
    case News::Nothing:
    case News::Frame:
      break;
    case News::WholeFrame:
      if (published_ == copy_->newest())
        publish({framed});
      else if (channel_->waiting_bytes() <= kBusyBytes)
        publish_frame(framed);
      break;
    case News::NewSurface:
      published_.reset();
      publish({framed});
      break;
    case News::LastFrame:
      if (copy_->has_frame() && published_ != copy_->newest()) publish_frame(copy_->state());
      barrier_ = framed;
      publish({framed});
      break;
    case News::Event:
    case News::Fleeting:
    case News::FinePart:
      publish({framed});
      break;
  }
}

void Publisher::publish_frame(const wire::SharedBytes& state) {
  encoder_.set_current(copy_->newest(), copy_->server_time_us(), state);
  const auto frame = published_ ? encoder_.delta_from(*published_) : encoder_.keyframe();
  published_ = copy_->newest();
  publish({frame, state});
}

// ---- to the bus ----

bool Publisher::is_active() const {
  return upstream_->is_welcome() && options_.clock_ns() - other_ns_ >= kTakeOverNs;
}

void Publisher::publish(const std::vector<wire::SharedBytes>& messages) {
  ++number_;  // also of what is left out: who takes the stream asks for all then
  answer_.clear();
  if (was_active_)
    send(subjects_.stream, joined(messages));
  else
    published_.reset();
}

void Publisher::send(const std::string& subject, BytesView whole) {
  const auto most = std::min(channel_->most_bytes(), kMostPieceBytes);
  if (most < kLeastBytes) return;
  if (whole.size() > kMostWholeBytes) {
    if (!std::exchange(is_large_told_, true))
      log::warn("{}: {} bytes at once were left out, at most {} go over NATS", options_.session,
                whole.size(), kMostWholeBytes);
    return;
  }
  for (auto& piece : cut(options_.id, number_, whole, most))
    channel_->send(subject, std::move(piece));
}

void Publisher::take_stream(BytesView bytes) {
  const auto piece = read_piece(bytes);
  if (!piece || piece->publisher == options_.id) return;
  if (was_active_ && piece->publisher > options_.id) return;
  other_ns_ = options_.clock_ns();
  if (!std::exchange(is_waiting_, true))
    log::info("another relay publishes the session as {}: waits for its end", options_.session);
  was_active_ = false;
}

void Publisher::take_ask(BytesView bytes, const std::string& answer_to) {
  if (!was_active_ || bytes.size() > kMostAskBytes || !subjects_.is_for_answers(answer_to)) return;
  const auto messages = split_messages(bytes);
  if (!messages) return;
  bool is_ponged = false;
  for (const auto message : *messages) {
    proto::Envelope asked;
    if (!wire::decode_envelope(message.subspan(wire::kHeaderBytes), asked)) return;
    if (asked.has_keyframe_request()) {
      answer_all(answer_to);
    } else if (asked.has_ping()) {
      if (!std::exchange(is_ponged, true)) answer_ping(answer_to, asked.ping().client_time_us());
    } else if (asked.has_relay_report()) {
      watchers_.note_taker(answer_to, asked.relay_report().watchers(), options_.clock_ns());
    }
  }
}

void Publisher::answer_ping(const std::string& answer_to, std::uint64_t client_time_us) {
  const auto now = options_.clock_ns();
  if (channel_->waiting_bytes() > kMostBytesBeforePong || !pongs_.take_if_left(1, now)) return;
  send(answer_to, *wire::encode_pong(client_time_us, copy_->newest() ? copy_->newest()->tick : 0,
                                     upstream_->server_time_us(now / 1000)));
}

// The picture in it is the one that the next difference is based on.
void Publisher::answer_all(const std::string& answer_to) {
  const auto now = options_.clock_ns();
  std::erase_if(answered_, [&](const auto& one) { return now - one.second >= kAnswerPauseNs; });
  if (!welcome_ || !copy_->has_frame() || channel_->waiting_bytes() > kMostAnswerBytes ||
      answered_.contains(answer_to) || !answers_.take_if_left(1, now))
    return;
  answered_[answer_to] = now;
  if (published_ != copy_->newest()) publish_frame(copy_->state());
  if (answer_.empty()) {
    std::vector<wire::SharedBytes> all{welcome_};
    for (auto& message : copy_->all_but_frames()) all.push_back(std::move(message));
    all.push_back(encoder_.keyframe());
    all.push_back(copy_->state());
    all.insert(all.end(), copy_->fine_parts().begin(), copy_->fine_parts().end());
    all.push_back(barrier_);
    all.push_back(goodbye_);
    answer_ = joined(all);
  }
  send(answer_to, answer_);
}

// ---- who watches ----

void Publisher::say(const proto::Envelope& message) {
  if (!message.has_relay_report()) return upstream_->say(message);
  watchers_.note_own(message.relay_report().watchers());
  report();
}

void Publisher::report() {
  if (!upstream_->is_welcome()) return;
  const auto watchers = watchers_.due(options_.clock_ns());
  if (!watchers) return;
  proto::Envelope envelope;
  envelope.mutable_relay_report()->set_watchers(*watchers);
  upstream_->say(envelope);
}

void Publisher::attend() {
  const auto most = channel_->most_bytes();
  if (most < kLeastBytes) other_ns_ = options_.clock_ns();  // another may be there first
  if (most > 0 && most < kLeastBytes && !std::exchange(is_small_told_, true))
    log::warn(
        "publishes nothing as {}: NATS takes messages of {} bytes, set max_payload to {} or "
        "more",
        options_.session, most, kLeastBytes);
  const bool was_active = std::exchange(was_active_, is_active());
  if (was_active && !was_active_)
    log::info("publishes nothing as {}: the server or NATS is gone", options_.session);
  if (!was_active && was_active_) log::info("publishes the session as {}", options_.session);
  if (was_active_) {
    is_waiting_ = false;
    channel_->send(subjects_.stream,
                   write_piece({.publisher = options_.id, .number = number_, .bytes = {}}));
  }
  report();
}

void Publisher::attend_often() {
  attend();
  next_.expires_after(kSignPeriod);
  next_.async_wait([this](boost::system::error_code error) {
    if (!error && events_.message) attend_often();
  });
}

}  // namespace trocar::bus
