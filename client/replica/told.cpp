#include "client/replica/told.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>

#include "client/replica/message_parts.h"
#include "common/wire/lesson.h"
#include "common/wire/tool_shape.h"
#include "proto/wire.pb.h"

namespace trocar::replica {
namespace {

// Two of a server's: it takes no more.
constexpr std::size_t kMostPoints = 2 * wire::kMostDrawingPoints;

Error bad(std::string what) {
  return {ErrorCode::BadMessage, std::move(what)};
}

// The points of a line that is to lie on the surface, near enough for its bends.
std::vector<Vec3f> dense(std::span<const Vec3f> line) {
  constexpr float kStepM = 0.002f;
  std::vector<Vec3f> points;
  for (std::size_t i = 0; i + 1 < line.size(); ++i) {
    const auto along = line[i + 1] - line[i];
    const auto steps = std::clamp(static_cast<int>(length(along) / kStepM), 1, 1000);
    for (int k = 0; k < steps; ++k)
      points.push_back(line[i] + along * (static_cast<float>(k) / static_cast<float>(steps)));
  }
  points.push_back(line.back());
  return points;
}

}  // namespace

std::optional<Vec3f> LessonView::target_m(Tick now) const {
  if (is_over || line_m.empty()) return std::nullopt;
  if (goal == Goal::Carry) return line_m.back();
  if (goal != Goal::Follow || !(lap_s > 0)) return std::nullopt;
  float whole = 0;
  for (std::size_t i = 0; i + 1 < line_m.size(); ++i) whole += length(line_m[i + 1] - line_m[i]);
  const double since_s =
      now > begin_tick ? static_cast<double>(now - begin_tick) * double{kTickSeconds} : 0.0;
  const auto part = static_cast<float>(std::fmod(since_s / double{lap_s}, 1.0));
  float way = whole * (part < 0.5f ? 2 * part : 2 - 2 * part);
  for (std::size_t i = 0; i + 1 < line_m.size(); ++i) {
    const auto along = line_m[i + 1] - line_m[i];
    const float span = length(along);
    if (way < span) return line_m[i] + along * (way / span);
    way -= span;
  }
  return line_m.back();
}

Status Told::take(const proto::Envelope& message, std::uint64_t arrival_ns) {
  switch (message.message_case()) {
    case proto::Envelope::kWelcome:
      apply(message.welcome());
      return {};
    case proto::Envelope::kParticipants:
      return apply(message.participants());
    case proto::Envelope::kClaimEvent:
      return apply(message.claim_event(), arrival_ns);
    case proto::Envelope::kMarkEvent: {
      const auto& mark = message.mark_event();
      mark_count_ += mark.is_done() ? 1 : 0;
      tell_all(mark.tick(), mark.text(), !mark.is_done(), arrival_ns);
      return {};
    }
    case proto::Envelope::kTeachEvent: {
      const auto& teach = message.teach_event();
      tell_all(teach.tick(), teach.text(), !teach.is_done() || teach.is_trouble(), arrival_ns);
      return {};
    }
    case proto::Envelope::kRecordingState:
      apply(message.recording_state());
      return {};
    case proto::Envelope::kPointEvent:
      return apply(message.point_event(), arrival_ns);
    case proto::Envelope::kDrawing:
      return apply(message.drawing());
    case proto::Envelope::kViewEvent:
      return apply(message.view_event(), arrival_ns);
    case proto::Envelope::kSessionPace:
      return apply(message.session_pace());
    case proto::Envelope::kMarkList:
      return apply(message.mark_list());
    case proto::Envelope::kLessonStage:
      return apply(message.lesson_stage());
    case proto::Envelope::kLessonProgress:
      apply(message.lesson_progress());
      return {};
    default:
      return {};
  }
}

// A second one begins the session's stream anew.
void Told::apply(const proto::Welcome& message) {
  server_minor_ = message.protocol_minor();
  if (!std::exchange(has_begun_, true)) return;
  strokes_.clear();
  lesson_strokes_ = 0;
  lesson_.reset();
  pace_ = {};
  marks_.clear();
  ++drawing_version_;
  led_view_.reset();
}

Status Told::apply(const proto::LessonStage& message) {
  constexpr int kMostLine = 64, kMostResults = 64, kMostLines = 32;
  if (message.line_m_size() > kMostLine || message.result_size() > kMostResults)
    return bad("LessonStage: too many points or results");
  if (message.picture().size() > wire::kMostPictureBytes)
    return bad("LessonStage.picture: too large");
  LessonView view;
  view.title = message.title();
  view.stage = message.stage(), view.stages = message.stages();
  view.name = message.name(), view.text = message.text(), view.hint = message.hint();
  const int goal = message.goal();
  for (const auto known : {LessonView::Goal::Find, LessonView::Goal::Follow,
                           LessonView::Goal::Incise, LessonView::Goal::Carry})
    if (goal == static_cast<int>(known)) view.goal = known;
  view.picture = message.picture();
  view.begin_tick = message.begin_tick();
  view.limit_s = message.limit_s(), view.force_limit_n = message.force_limit_n();
  view.lap_s = message.lap_s(), view.tolerance_m = message.tolerance_m();
  for (const auto& place : message.line_m()) {
    const Vec3f at = to_vec3(place);
    if (!is_finite(at) || length(at) > wire::kMostViewDistanceM)
      return bad("LessonStage.line_m: not finite, or too far away");
    view.line_m.push_back(at);
  }
  for (const auto& entry : message.result()) {
    if (entry.line_size() > kMostLines) return bad("LessonStage.result: too many lines");
    view.results.push_back({entry.name(),
                            entry.is_reached(),
                            entry.seconds(),
                            entry.points(),
                            {entry.line().begin(), entry.line().end()}});
  }
  view.is_over = message.is_over(), view.points = message.points();
  const bool is_given = message.stages() > 0;
  if (lesson_ && lesson_->stage == view.stage && lesson_->begin_tick == view.begin_tick)
    view.progress = lesson_->progress, view.seconds = lesson_->seconds;
  strokes_.erase(strokes_.begin(), strokes_.begin() + static_cast<std::ptrdiff_t>(lesson_strokes_));
  lesson_strokes_ = view.goal == LessonView::Goal::Incise && !view.is_over && !view.line_m.empty();
  if (lesson_strokes_ > 0) strokes_.insert(strokes_.begin(), Stroke{{}, dense(view.line_m)});
  ++drawing_version_;
  lesson_.reset();
  if (is_given) lesson_ = std::move(view);
  return {};
}

void Told::apply(const proto::LessonProgress& message) {
  if (!lesson_) return;
  lesson_->progress = std::clamp(message.progress(), 0.0f, 1.0f);
  lesson_->seconds = std::max(0.0f, message.seconds());
  lesson_->is_too_strong = message.is_too_strong();
}

Status Told::apply(const proto::SessionPace& message) {
  if (!(message.rate() > 0 && message.rate() <= 1)) return bad("SessionPace.rate: over 0, to 1");
  pace_ = {message.rate(), message.is_paused(), message.by()};
  return {};
}

Status Told::apply(const proto::MarkList& message) {
  if (message.name_size() > static_cast<int>(wire::kMostMarks))
    return bad("MarkList: too many marks");
  marks_.assign(message.name().begin(), message.name().end());
  return {};
}

void Told::tell_all(Tick tick, const std::string& text, bool is_refused, std::uint64_t arrival_ns) {
  Notice notice;
  notice.tick = tick;
  notice.text = text;
  notice.arrival_ns = arrival_ns;
  notice.is_for_all = true;
  notice.is_refused = is_refused;
  add_notice(std::move(notice));
}

Status Told::apply(const proto::PointEvent& message, std::uint64_t arrival_ns) {
  if (message.participant() >= kMaxParticipants) return bad("PointEvent: slot out of range");
  const ParticipantSlot who{static_cast<std::uint8_t>(message.participant())};
  std::erase_if(pointers_, [who](const Pointer& known) { return known.participant == who; });
  if (!message.has_position_m()) return {};
  const Vec3f place = to_vec3(message.position_m());
  if (!is_finite(place)) return bad("PointEvent.position_m: not finite");
  pointers_.push_back({who, place, arrival_ns});
  return {};
}

std::vector<Pointer> Told::pointers(std::uint64_t now_ns) const {
  std::vector<Pointer> shown;
  for (const auto& pointer : pointers_)
    if (now_ns < pointer.arrival_ns + kPointerNs) shown.push_back(pointer);
  return shown;
}

Status Told::apply(const proto::Drawing& message) {
  auto strokes = strokes_;
  if (!message.is_addition()) strokes.resize(lesson_strokes_);
  std::size_t points = 0;
  for (const auto& stroke : strokes) points += stroke.rest_m.size();
  for (const auto& entry : message.stroke()) {
    if (entry.participant() >= kMaxParticipants) return bad("Drawing: slot out of range");
    if (entry.rest_quanta_size() % 3 != 0) return bad("Drawing: a point has three numbers");
    points += static_cast<std::size_t>(entry.rest_quanta_size()) / 3;
    if (points > kMostPoints) return bad("Drawing: it has too many points");
    auto& stroke = strokes.emplace_back();
    stroke.participant = {static_cast<std::uint8_t>(entry.participant())};
    wire::QuantisedVertex at{};
    for (int i = 0; i < entry.rest_quanta_size(); i += 3) {
      const std::array<std::int64_t, 3> next{std::int64_t{at.x} + entry.rest_quanta(i),
                                             std::int64_t{at.y} + entry.rest_quanta(i + 1),
                                             std::int64_t{at.z} + entry.rest_quanta(i + 2)};
      for (const auto value : next)
        if (value < -2 * wire::kMaxQuanta || value > 2 * wire::kMaxQuanta)
          return bad("Drawing: a point is farther than 2 m from the origin");
      at = {static_cast<std::int32_t>(next[0]), static_cast<std::int32_t>(next[1]),
            static_cast<std::int32_t>(next[2])};
      stroke.rest_m.push_back(wire::to_metres(at));
    }
  }
  strokes_ = std::move(strokes);
  if (!message.is_addition()) ++drawing_version_;
  return {};
}

Status Told::apply(const proto::ViewEvent& message, std::uint64_t arrival_ns) {
  if (message.participant() >= kMaxParticipants) return bad("ViewEvent: slot out of range");
  const LedView view{{static_cast<std::uint8_t>(message.participant())},
                     to_vec3(message.eye_m()),
                     to_vec3(message.target_m()),
                     arrival_ns};
  if (!is_finite(view.eye_m) || !is_finite(view.target_m))
    return bad("ViewEvent: eye_m or target_m is not finite");
  if (length(view.eye_m - view.target_m) < wire::kLeastViewM) return {};
  led_view_ = view;
  return {};
}

Status Told::apply(const proto::Participants& message) {
  participants_.clear();
  for (const auto& entry : message.participant()) {
    if (entry.slot() >= kMaxParticipants) return bad("Participants: slot out of range");
    Participant participant;
    participant.slot.value = static_cast<std::uint8_t>(entry.slot());
    participant.name = entry.name();
    participant.role = wire::role_of(entry.role());
    for (const auto& shape : entry.tool()) participant.tools.push_back(wire::read(shape));
    participant.is_away = entry.is_away();
    participant.frozen_by = entry.frozen_by();
    participant.lent_tools = entry.lent_tools();
    participant.leads_view = entry.leads_view();
    participant.relayed = entry.relayed_watchers();
    participants_.push_back(std::move(participant));
  }
  std::ranges::sort(participants_, {}, &Participant::slot);
  if (std::ranges::none_of(participants_, &Participant::leads_view)) led_view_.reset();
  return {};
}

Status Told::apply(const proto::ClaimEvent& message, std::uint64_t arrival_ns) {
  if (message.tool() >= kMaxTools) return bad("ClaimEvent.tool: slot out of range");
  Notice notice;
  notice.tick = message.tick();
  notice.tool.value = static_cast<std::uint8_t>(message.tool());
  notice.verb = to_verb(message.verb());
  if (message.outcome() >= 0 && message.outcome() < wire::kClaimOutcomes)
    notice.outcome = static_cast<ClaimOutcome>(message.outcome());
  notice.holder = message.holder_name();
  notice.text = message.text();
  notice.arrival_ns = arrival_ns;
  add_notice(std::move(notice));
  return {};
}

void Told::add_notice(Notice notice) {
  notices_.push_back(std::move(notice));
  if (notices_.size() > kMaxNotices) notices_.pop_front();
  ++notice_count_;
}

void Told::apply(const proto::RecordingState& message) {
  const bool is_known = message.status() >= 0 && message.status() <= proto::RECORDING_FAILED;
  recording_.status = is_known ? static_cast<wire::RecordingStatus>(message.status())
                               : wire::RecordingStatus::Unknown;
  recording_.frames_missing = message.frames_missing();
  recording_.text = message.text().substr(0, kMaxRecordingText);
}

const Participant* Told::find_participant(ParticipantSlot slot) const {
  const auto found = std::ranges::find(participants_, slot, &Participant::slot);
  return found == participants_.end() ? nullptr : &*found;
}

}  // namespace trocar::replica
