#include "server/session/replication/pace.h"

#include "proto/wire.pb.h"

namespace trocar::replication {
namespace {

constexpr const char* kOwnPace = "not done: this session keeps its own pace";

}  // namespace

std::string Pace::slow(float rate, const std::string& by) {
  if (!session_.options.on_pace) return kOwnPace;
  rate_ = rate;
  tell(by);
  return {};
}

std::string Pace::pause(bool pauses, const std::string& by) {
  if (!session_.options.on_pace) return kOwnPace;
  if (pauses == is_paused_)
    return pauses ? "not done: it is paused already" : "not done: it goes on already";
  is_paused_ = pauses;
  tell(by);
  return {};
}

void Pace::reset() {
  if (is_usual()) return;
  is_paused_ = false;
  rate_ = 1;
  tell({});
}

bool Pace::show(const Speaker& newcomer) const {
  return (is_usual() && by_.empty()) || session_.audience.send(newcomer, message());
}

// Hands move on while time stands still: their tools go back to them as after a freeze.
void Pace::tell(const std::string& by) {
  by_ = by;
  for (const auto& who : session_.roster.list()) {
    if (!who.slot.has_tools()) continue;
    if (is_paused_)
      held_.freeze(who.slot);
    else if (who.frozen_by.empty())
      held_.release(who.slot);
  }
  session_.options.on_pace(is_paused_ ? 0 : rate_);
  session_.audience.broadcast(message());
}

wire::SharedBytes Pace::message() const {
  proto::Envelope message;
  auto& pace = *message.mutable_session_pace();
  pace.set_rate(rate_);
  pace.set_is_paused(is_paused_);
  pace.set_by(by_);
  return wire::encode_envelope(message);
}

}  // namespace trocar::replication
