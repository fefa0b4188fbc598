#include "server/watch/bus/tap.h"

#include <algorithm>

#include "common/base/log.h"
#include "common/base/printable.h"
#include "common/secure/digest.h"
#include "proto/wire.pb.h"

namespace trocar::bus {
namespace {

using wire::EndReason;

constexpr std::chrono::milliseconds kPeriod{100};
constexpr std::uint64_t kFirstPauseNs = 500'000'000, kLongestPauseNs = 4'000'000'000;
constexpr std::uint64_t kPingNs = 500'000'000;
constexpr std::size_t kIdBytes = 8, kEarlyCostBytes = 64;  // of one that waits, beside it

std::string random_id() {
  Bytes id(kIdBytes);
  secure::fill_random(id);
  return secure::to_hex(id);
}

// Returns how many thousandths shorter this one's pauses are: 0 to 255, by the id's last byte.
std::uint64_t shortening_of(const std::string& id) {
  return std::stoul(id.substr(id.size() - 2), nullptr, 16);
}

// False: it is no message, or there are several.
bool read_single_message(BytesView whole, proto::Envelope& message) {
  const auto messages = split_messages(whole);
  return messages && messages->size() == 1 &&
         wire::decode_envelope(messages->front().subspan(wire::kHeaderBytes), message).ok();
}

}  // namespace

Tap::Tap(asio::any_io_executor executor, std::unique_ptr<Channel> channel, TapOptions options)
    : Follower(options.clock_ns),
      channel_(std::move(channel)),
      options_(std::move(options)),
      subjects_(options_.session),
      answers_(subjects_.answers_to(random_id())),
      shortened_(shortening_of(answers_)),
      next_(executor),
      why_("nobody publishes the session " + options_.session + " there") {}

Tap::~Tap() = default;

std::string Tap::name() const {
  return options_.session + " (over NATS)";
}

Status Tap::listen() {
  auto heard = channel_->listen(
      subjects_.stream, [this](BytesView bytes, const std::string&) { take_stream(bytes); });
  if (!heard) return heard;
  return channel_->listen(answers_,
                          [this](BytesView bytes, const std::string&) { take_answer(bytes); });
}

void Tap::start(follow::UpstreamEvents events) {
  Follower::begin(std::move(events));
  ask_for_all();
  attend_often();
}

void Tap::stop() {
  finish();
  cut();
}

// ---- what comes ----

void Tap::take_stream(BytesView bytes) {
  if (is_over()) return;
  const auto piece = read_piece(bytes);
  if (!piece) {
    ++counters_.wrong;
    return;
  }
  if (is_following_) return take_piece(*piece);
  if (was_welcome() && piece->publisher == publisher_ && piece->pieces == 1)
    note_goodbye(piece->bytes);
  early_.emplace_back(bytes.begin(), bytes.end());
  early_bytes_ += bytes.size() + kEarlyCostBytes;
  while (early_bytes_ > kMostEarlyBytes) {
    early_bytes_ -= early_.front().size() + kEarlyCostBytes;
    early_.pop_front();
  }
}

void Tap::take_piece(const Piece& piece) {
  if (piece.publisher != publisher_ || piece.number < number_) return;
  followed_ns_ = now_ns();
  bytes_ += kPieceHeaderBytes + piece.bytes.size();
  const bool is_sign = piece.pieces == 0;
  if (piece.number == number_) return;
  const auto whole = is_sign || piece.number != number_ + 1
                         ? Result<std::optional<Bytes>>(Error{ErrorCode::BadMessage, "a gap"})
                         : stream_.add(piece);
  if (!whole) {
    ++counters_.gaps;
    return lose_count("something was left out on the way");
  }
  if (!*whole) return;
  ++number_;
  take_messages(**whole);
}

void Tap::take_answer(BytesView bytes) {
  if (is_over()) return;
  const auto piece = read_piece(bytes);
  if (!piece || piece->pieces == 0) {
    ++counters_.wrong;
    return;
  }
  if (is_following_) {
    if (piece->publisher == publisher_ && piece->pieces == 1) take_pong(piece->bytes);
    return;
  }
  // Two may answer: the first one is heard to its end, unless it is silent.
  const bool is_busy = answering_ != 0 && now_ns() - asked_ns_ < pause_ns_;
  if (piece->publisher != answering_ && (is_busy || piece->piece != 0)) return;
  answering_ = piece->publisher;
  asked_ns_ = now_ns();
  bytes_ += bytes.size();
  const auto whole = answer_.add(*piece);
  if (!whole || *whole) answering_ = 0;
  if (whole && *whole) take_all(*piece, **whole);
}

// Also answers to a Ping that was sent before count was lost come here: they begin with no Welcome.
void Tap::take_all(const Piece& last, BytesView whole) {
  const auto messages = split_messages(whole);
  proto::Envelope first;
  const bool is_all =
      messages && !messages->empty() &&
      wire::decode_envelope(messages->front().subspan(wire::kHeaderBytes), first).ok() &&
      first.has_welcome();
  if (!is_all) return;
  is_following_ = true;
  publisher_ = last.publisher;
  number_ = last.number;
  stream_ = {};
  followed_ns_ = now_ns();
  goodbye_.reset();
  const auto early = std::exchange(early_, {});
  early_bytes_ = 0;
  if (!take_messages(whole)) return;
  pause_ns_ = kFirstPauseNs;
  for (const auto& bytes : early) {
    if (!is_following_ || is_over()) return;
    take_piece(*read_piece(bytes));
  }
}

void Tap::take_pong(BytesView whole) {
  proto::Envelope message;
  if (read_single_message(whole, message) && message.has_pong())
    clock_.add(message.pong().client_time_us(), message.pong().server_time_us(), now_ns() / 1000);
}

void Tap::note_goodbye(BytesView whole) {
  proto::Envelope message;
  if (read_single_message(whole, message) && message.has_goodbye())
    goodbye_ = printable(message.goodbye().text(), 200);
}

bool Tap::take_messages(BytesView whole) {
  const auto messages = split_messages(whole);
  if (!messages) {
    ++counters_.wrong;
    lose_count(messages.error().message);
    return false;
  }
  return std::ranges::all_of(*messages, [this](BytesView framed) {
    return take_message(framed) && is_following_ && !is_over();
  });
}

bool Tap::take_message(BytesView framed) {
  const auto body = framed.subspan(wire::kHeaderBytes);
  proto::Envelope message;
  auto taken = wire::decode_envelope(body, message);
  if (taken && message.has_goodbye()) {
    end(EndReason::ServerClosing, printable(message.goodbye().text(), 200));
    return false;
  }
  if (taken && message.has_welcome()) {
    clock_ = {};  // it may be another publisher's server, or one that began anew
    pinged_ns_ = 0;
    return take_welcome(message.welcome());
  }
  if (taken) taken = hand_on(message, wire::frame_body(body));
  if (taken) return true;
  ++counters_.wrong;
  lose_count(printable(taken.error().message, 200));
  return false;
}

// ---- what is asked ----

void Tap::lose_count(const std::string& why) {
  if (!std::exchange(is_following_, false)) return;
  log::debug("{}: asks for everything, because {}", name(), why);
  why_ = why;
  if (now_ns() - asked_ns_ >= kFirstPauseNs) ask_for_all();
}

void Tap::ask_for_all() {
  asked_ns_ = now_ns();
  pause_ns_ = std::clamp(2 * pause_ns_, kFirstPauseNs, kLongestPauseNs);
  answering_ = 0;
  ++counters_.asks;
  proto::Envelope question;
  question.mutable_keyframe_request();
  ask(question);
}

void Tap::ask(const proto::Envelope& question) {
  channel_->send(subjects_.ask, *wire::encode_envelope(question), answers_);
}

void Tap::say(const proto::Envelope& message) {
  if (message.has_keyframe_request()) lose_count("a frame does not fit");
  if (message.has_relay_report()) watchers_ = message.relay_report().watchers();
}

void Tap::attend() {
  if (is_over()) return;
  const auto time = now_ns();
  if (time - followed_ns_ > kSilenceNs) {
    if (is_following_) lose_count("its publisher is silent");
    lose(why_);
  }
  if (is_too_late()) return end(EndReason::ServerClosing, why_);
  if (!is_following_ && time - asked_ns_ >= pause_ns_ - pause_ns_ / 1000 * shortened_) {
    if (goodbye_) return end(EndReason::ServerClosing, *goodbye_);
    ask_for_all();
  }
  if (!is_following_ || time - pinged_ns_ < kPingNs) return;
  pinged_ns_ = time;
  proto::Envelope ping, report;
  ping.mutable_ping()->set_client_time_us(time / 1000);
  ask(ping);
  report.mutable_relay_report()->set_watchers(watchers_);
  ask(report);
}

void Tap::attend_often() {
  attend();
  if (is_over()) return;
  next_.expires_after(kPeriod);
  next_.async_wait([this](boost::system::error_code error) {
    if (!error) attend_often();
  });
}

}  // namespace trocar::bus
