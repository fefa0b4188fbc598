#include "server/session/recording/recorded_overview.h"

#include <utility>
#include <vector>

#include "common/budget/message_budget.h"
#include "proto/journal.pb.h"
#include "proto/wire.pb.h"

namespace trocar::recording {
namespace {

using journal::JournalTopic;

constexpr std::uint32_t kLastVerb = 3;

template <typename Message>
bool decode(BytesView bytes, Message& message) {
  return check_budget(*Message::descriptor(), bytes, build_budget(bytes.size())).ok() &&
         message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()));
}

Vec3f vector_of(const proto::Vec3& v) {
  return {v.x(), v.y(), v.z()};
}

}  // namespace

Result<std::optional<proto::Overview>> RecordedOverview::take(JournalTopic topic, Tick tick,
                                                              BytesView bytes) {
  std::optional<proto::Overview> full;
  const auto with = [&](auto message, const auto& use) {
    if (!decode(bytes, message)) return false;
    use(message);
    return true;
  };
  bool is_read = true;
  switch (topic) {
    case JournalTopic::Participants:
      is_read =
          with(proto::Participants(), [&](const auto& list) { builder_.add_presence(tick, list); });
      break;
    case JournalTopic::Lesson:
      is_read = with(proto::LessonRecord(), [&](const auto& record) { take_lesson(tick, record); });
      break;
    case JournalTopic::Gap:
      is_read = with(proto::JournalGap(), [&](const auto& gap) { full = take_gap(gap); });
      break;
    case JournalTopic::TopologyChange:
      builder_.add_change(tick);
      break;
    case JournalTopic::SurfaceDelta:
      last_delta_tick_ = tick;
      break;
    case JournalTopic::SurfaceKey:
      if (!std::exchange(expects_key_, false) && last_delta_tick_ != tick)
        builder_.add_change(tick);
      break;
    case JournalTopic::Claims:
      is_read = with(proto::ClaimLog(), [&](const auto& log) {
        for (const auto& event : log.event()) builder_.add_claim(event);
      });
      break;
    case JournalTopic::FrameState:
      is_read = with(proto::FrameState(), [&](const auto& state) { full = take_frame(state); });
      break;
    default:
      break;
  }
  if (is_read) return full;
  return Error{ErrorCode::BadFile, std::string(journal::topic_name(topic)) +
                                       ": the message at tick " + std::to_string(tick) +
                                       " cannot be read"};
}

std::optional<proto::Overview> RecordedOverview::take_gap(const proto::JournalGap& gap) {
  expects_key_ = true;
  builder_.add_gap(gap);
  if (gap.is_join() || !builder_.is_behind(gap.last_tick())) return {};
  auto overview = builder_.take();
  builder_.skip_to(gap.last_tick());
  return overview;
}

void RecordedOverview::take_lesson(Tick tick, const proto::LessonRecord& record) {
  if (record.has_teach()) builder_.add_lesson(record.teach());
  if (record.has_stage()) builder_.add_stage(tick, record.stage());
}

std::optional<proto::Overview> RecordedOverview::take_frame(const proto::FrameState& state) {
  std::vector<OverviewBuilder::ToolMoment> tools;
  for (const auto& tool : state.tool()) {
    if (tool.tool() >= kMaxTools) continue;
    const auto verb = static_cast<std::uint32_t>(tool.verb());
    tools.push_back({.tool = ToolSlot{static_cast<std::uint8_t>(tool.tool())},
                     .verb = verb <= kLastVerb ? verb : 0,
                     .has_claim = tool.has_claim(),
                     .force_n = vector_of(tool.force_n()),
                     .tip = vector_of(tool.has_proxy_position_m() ? tool.proxy_position_m()
                                                                  : tool.position_m())});
  }
  builder_.add_tools(state.tick(), tools);
  if (!builder_.is_full()) return {};
  return builder_.take();
}

std::optional<proto::Overview> RecordedOverview::rest() {
  if (builder_.is_empty()) return {};
  return builder_.take();
}

}  // namespace trocar::recording
