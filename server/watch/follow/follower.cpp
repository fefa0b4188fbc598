#include "server/watch/follow/follower.h"

#include <utility>

#include "common/base/log.h"
#include "common/base/version.h"
#include "proto/wire.pb.h"

namespace trocar::follow {

void Follower::begin(UpstreamEvents events) {
  events_ = std::move(events);
  deadline_ns_ = now_ns() + kReachNs;
}

bool Follower::finish() {
  events_ = {};
  return !std::exchange(is_over_, true);
}

void Follower::end(wire::EndReason reason, const std::string& text) {
  const auto over = events_.over;
  if (!finish()) return;
  cut();
  if (over) over(reason, text);
}

bool Follower::take_welcome(const proto::Welcome& welcome) {
  if (welcome.protocol_major() != kProtocolMajor) {
    end(wire::EndReason::Version, name() + " speaks another protocol: use programs of one release");
    return false;
  }
  is_welcome_ = true;
  if (std::exchange(was_welcome_, true)) ++returns_;
  if (const auto told = events_.welcome) told(welcome);  // a copy: it may stop this
  return !is_over_;
}

Status Follower::hand_on(const proto::Envelope& message, const wire::SharedBytes& framed) {
  const auto take = events_.message;  // a copy: it may stop this
  return take ? take(message, framed) : Status();
}

bool Follower::lose(const std::string& why) {
  if (!std::exchange(is_welcome_, false)) return false;
  deadline_ns_ = now_ns() + kReturnNs;
  log::warn("{} stands still ({}): trying again", name(), why);
  if (const auto lost = events_.lost) lost(why);
  return true;
}

}  // namespace trocar::follow
