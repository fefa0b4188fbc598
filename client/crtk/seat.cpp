#include "client/crtk/seat.h"

#include <algorithm>

#include "client/replica/client_messages.h"

namespace trocar::crtk {
namespace {

constexpr std::uint64_t kAliveNs = 20'000'000;  // a lease wants a sample every 50 ms
constexpr std::uint64_t kTickNs = kTickNanoseconds;

}  // namespace

Seat::Seat(net::NetSourceOptions options)
    : source_(std::move(options)),
      replica_([this](const proto::Envelope& message) { return source_.send(message); }) {}

bool Seat::is_closed() const {
  return source_.state() == replica::SourceState::Closed || !replica_.fault().ok();
}

replica::CloseReason Seat::closed() const {
  if (!replica_.fault().ok()) return {replica::CloseKind::Lost, replica_.fault().error().message};
  return source_.close_reason();
}

std::string Seat::fault() const {
  if (source_.state() == replica::SourceState::Away) return "the session cannot be reached";
  const bool is_in = source_.state() == replica::SourceState::Live && replica_.newest() != nullptr;
  return is_in ? "" : "the session has not answered yet";
}

const replica::Participant* Seat::self() const {
  return replica_.told().find_participant(replica_.own_slot());
}

std::string Seat::hold() const {
  const auto* me = self();
  if (me == nullptr || me->frozen_by.empty()) return "";
  return me->frozen_by + " keeps the tool where it is";
}

std::optional<std::string> Seat::pop_told() {
  const auto& told = replica_.told();
  const auto& notices = told.notices();
  notices_ = std::max<std::uint64_t>(notices_, told.notice_count() - notices.size());
  while (notices_ < told.notice_count()) {
    const auto back = told.notice_count() - notices_++;
    const auto& notice = notices[notices.size() - back];
    if (notice.tool == tool_slot(replica_.own_slot(), 0) && !notice.text.empty())
      return notice.text;
  }
  return std::nullopt;
}

bool Seat::is_due(const tool::ToolSample& sample, std::uint64_t now_ns) const {
  if (!fault().empty()) return false;
  return now_ns - sent_ns_ >= kAliveNs || (sent_ != sample && pause_ns(now_ns) == 0);
}

std::uint64_t Seat::pause_ns(std::uint64_t now_ns) const {
  const auto next_ns = sent_ns_ + kTickNs;
  return next_ns > now_ns ? next_ns - now_ns : 0;
}

void Seat::send(const tool::ToolSample& sample, std::uint64_t now_ns) {
  // One that is dropped is due again.
  if (!replica::send_tool_sample(source_, 0, ++sequence_, sample)) return;
  sent_ = sample;
  sent_ns_ = now_ns;
}

std::optional<Seat::Seen> Seat::see_tool() {
  const auto& history = replica_.history();
  for (auto frame = history.rbegin(); frame != history.rend(); ++frame) {
    if (!frame->has_state) continue;
    if (frame->tick == seen_tick_) return std::nullopt;
    const auto slot = tool_slot(replica_.own_slot(), 0);
    const auto tool = std::ranges::find(frame->tools, slot, &replica::Tool::slot);
    if (tool == frame->tools.end()) return std::nullopt;
    seen_tick_ = frame->tick;
    return Seen{*tool, frame->tick};
  }
  return std::nullopt;
}

}  // namespace trocar::crtk
