#include "server/watch/crowd/crowd.h"

#include <algorithm>

#include "common/base/ids.h"
#include "common/base/log.h"
#include "common/secure/digest.h"
#include "common/wire/blood_codec.h"
#include "proto/wire.pb.h"
#include "server/session/replication/messages.h"
#include "server/tissue/step/published_frame.h"
#include "server/watch/crowd/crowd_watcher.h"

namespace trocar::crowd {
namespace {

using follow::News;
using replication::EndReason;

constexpr std::uint64_t kReportIntervalNs = 1'100'000'000;  // the server takes one in a second
constexpr std::size_t kMuchWaitingBytes = 64 * 1024;
constexpr std::size_t kTokenBytes = 16;

}  // namespace

Crowd::Crowd(net::Connections& connections, CrowdOptions options)
    : connections_(connections),
      options_(std::move(options)),
      copy_(std::make_unique<follow::SessionCopy>()),
      encoder_(std::make_unique<replication::FrameEncoder>()) {}

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
  // Who has a part of the fine surface alone gets it anew, whole.
  for (const auto& [id, watcher] : watchers_)
    if (!copy_->has_all_fine_parts() || watcher->fine_parts.next() < copy_->fine_parts().size())
      watcher->fine_parts.begin();
  copy_ = std::make_unique<follow::SessionCopy>();
  barrier_frame_.reset();
  is_new_ = true;
  if (reported_ != 0) reported_.reset();
  if (is_other) restart();
}

bool Crowd::has_picture() const {
  return encoder_->current() && copy_->has_frame() && encoder_->current()->epoch == copy_->epoch();
}

std::size_t Crowd::topology_bytes() {
  return copy_->topology()->size();
}

Status Crowd::take(const proto::Envelope& message, const wire::SharedBytes& framed) {
  const auto news = copy_->take(message, framed);
  if (!news) return news.error();
  if (copy_->needs_keyframe()) {
    proto::Envelope request;
    request.mutable_keyframe_request();
    options_.say_up(request);
  }
  switch (*news) {
    case News::Nothing:
    case News::FinePart:  // give_all() gives it
      break;
    case News::Frame:
      acknowledge();
      break;
    case News::WholeFrame:
      publish(framed);
      break;
    case News::NewSurface:
      encoder_->forget_changes();
      for (const auto& [id, watcher] : watchers_) watcher->feed.forget_before(newest_frame() + 1);
      broadcast(framed, false);
      break;
    case News::Event:
      if (message.has_surface_change())
        encoder_->add_change(message.surface_change().epoch(), framed);
      broadcast(framed, false);
      break;
    case News::Fleeting:
      broadcast(framed, true);
      break;
    case News::LastFrame:
      acknowledge();
      begin_barrier(framed);
      break;
  }
  return {};
}

void Crowd::acknowledge() {
  if (!copy_->has_frame()) return;
  proto::Envelope envelope;
  copy_->acknowledge(*envelope.mutable_frame_ack());
  options_.say_up(envelope);
}

void Crowd::publish(const wire::SharedBytes& state) {
  const auto& before = encoder_->current();
  const bool is_earlier = before && copy_->frame() < before->frame;
  if (std::exchange(is_new_, false) && is_earlier) restart();
  auto frame = std::make_shared<step::PublishedFrame>();
  frame->frame = copy_->frame();
  frame->tick = copy_->tick();
  frame->epoch = copy_->epoch();
  frame->surface = copy_->surface();
  frame->surface_crc = copy_->surface_crc();
  frame->blood = copy_->blood();
  if (!frame->blood.empty()) frame->blood_crc = wire::blood_crc(frame->blood);
  encoder_->set_current(std::move(frame), copy_->server_time_us(), state);
  ++frame_counters_.frames_published;
  give_all();
}

void Crowd::give_all() {
  if (!has_picture()) return;
  for (auto next = watchers_.begin(); next != watchers_.end();) {
    auto& watcher = *next->second;
    ++next;  // ending one erases it
    const bool waits =
        !watcher.has_begun && (watcher.is_carrier || (watcher.is_welcome && watcher.carrier == 0));
    if (waits && !show_all(watcher))
      end_watcher(watcher, {EndReason::TooSlow, "the first messages do not fit"});
    else if (!waits && watcher.listens()) {
      give_frame(watcher, false);
      give_fine_part(watcher);
    }
  }
}

void Crowd::begin_barrier(const wire::SharedBytes& barrier) {
  if (!copy_->has_frame()) return;
  if (!has_picture() || newest_frame() != copy_->frame()) publish(copy_->state());
  barrier_frame_ = copy_->frame();
  barrier_crc_ = copy_->surface_crc();
  for (auto next = watchers_.begin(); next != watchers_.end();) {
    auto& watcher = *next->second;
    ++next;
    if (watcher.listens() &&
        (!give_frame(watcher, true) || !connections_.send(watcher.id, barrier)))
      end_watcher(watcher, {EndReason::TooSlow, "your connection is too slow for the last frame"});
  }
}

void Crowd::broadcast(const wire::SharedBytes& bytes, bool is_fleeting) {
  for (auto next = watchers_.begin(); next != watchers_.end();) {
    auto& watcher = *next->second;
    ++next;
    if (!watcher.listens()) continue;
    if (is_fleeting && connections_.outstanding_bytes(watcher.id) > kMuchWaitingBytes) continue;
    const bool is_sent = connections_.send(watcher.id, bytes);
    frame_counters_.bytes_queued += is_sent ? bytes->size() : 0;
    if (!is_sent && !is_fleeting)
      end_watcher(watcher,
                  {EndReason::TooSlow,
                   "your connection is too slow: messages that cannot be skipped piled up"});
  }
}

void Crowd::note_lost() {
  proto::Envelope envelope;
  auto& event = *envelope.mutable_teach_event();
  event.set_is_done(true);
  event.set_is_trouble(true);
  event.set_text("the relay has lost the server: the picture stands still until it is back");
  broadcast(wire::encode_envelope(envelope), true);
}

void Crowd::attend() {
  give_all();
  report_number();
}

void Crowd::report_number() {
  const auto now = options_.limits.clock_ns();
  if (is_new_ || watchers_here_ == reported_ || now - reported_ns_ < kReportIntervalNs) return;
  reported_ = watchers_here_;
  reported_ns_ = now;
  log::info("{} watchers here", watchers_here_);
  proto::Envelope envelope;
  envelope.mutable_relay_report()->set_watchers(static_cast<std::uint32_t>(watchers_here_));
  options_.say_up(envelope);
}

// Frames of before are no base for those that come now, and numbers begin at an earlier one.
void Crowd::restart() {
  encoder_ = std::make_unique<replication::FrameEncoder>();
  if (watchers_.empty()) return;
  ++counters_.restarts;
  log::info("the session goes on from an earlier frame: {} watchers begin anew", watchers_here_);
  std::vector<net::ConnectionId> connections;
  for (const auto& [id, watcher] : watchers_)
    if (watcher->carrier == 0) connections.push_back(id);
  for (const auto id : connections) connections_.close(id);
}

void Crowd::end_all(EndReason reason, const std::string& text) {
  while (!watchers_.empty()) end_watcher(*watchers_.begin()->second, {reason, text});
}

// ---- who is here ----

void Crowd::on_open(net::ConnectionId id) {
  watchers_.emplace(id, std::make_unique<Watcher>(connections_, id, options_, frame_counters_));
}

void Crowd::on_close(net::ConnectionId id) {
  if (const auto found = watchers_.find(id); found != watchers_.end()) forget(*found->second);
}

void Crowd::on_fault(net::ConnectionId id, net::ConnectionFault fault) {
  const auto found = watchers_.find(id);
  if (found == watchers_.end()) return connections_.close(id);
  const bool is_timeout =
      fault == net::ConnectionFault::HelloTimeout || fault == net::ConnectionFault::IdleTimeout;
  end_watcher(*found->second,
              {is_timeout ? EndReason::Timeout : EndReason::ProtocolError, net::describe(fault)});
}

void Crowd::forget(Watcher& watcher) {
  watchers_here_ -= watcher.is_welcome;
  watchers_.erase(watcher.id);
}

void Crowd::end_watcher(Watcher& watcher, const Ending& ending) {
  if (ending.reason != EndReason::ServerClosing) {
    log::debug("connection {} ended: {}", watcher.id, ending.text);
    ++(watcher.is_welcome ? counters_.ended : counters_.refused);
  }
  const auto id = watcher.id;
  forget(watcher);
  connections_.close_after_flush(id, replication::encode_goodbye(ending.reason, ending.text));
}

bool Crowd::show_all(Watcher& watcher) {
  watcher.has_begun = true;
  for (const auto& message : copy_->all_but_frames())
    if (!connections_.send(watcher.id, message)) return false;
  return give_frame(watcher, true);
}

void Crowd::give_fine_part(Watcher& watcher) {
  auto& parts = watcher.fine_parts;
  if (parts.next() >= copy_->fine_parts().size() || !parts.may_send(newest_frame())) return;
  // The newest frame may still be there, but no queue.
  const auto limit =
      std::max(options_.limits.skip_above_bytes / 4, 2 * encoder_->typical_frame_bytes());
  if (connections_.outstanding_bytes(watcher.id) > limit) return;
  if (connections_.send(watcher.id, copy_->fine_parts()[parts.next()]))
    parts.on_sent(newest_frame());
}

bool Crowd::give_frame(Watcher& watcher, bool is_required) {
  const bool is_lost = watcher.feed.is_keyframe_due() && encoder_->current()->epoch > 0;
  if (is_lost && !connections_.send(watcher.id, copy_->topology())) return false;
  return watcher.feed.give(*encoder_, is_required);
}

}  // namespace trocar::crowd
