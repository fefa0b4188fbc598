#include "server/session/recording/lesson_frames.h"

#include <fmt/format.h>

#include <utility>

#include "common/wire/claim_outcome.h"
#include "server/session/recording/stored_surface.h"

namespace trocar::recording {
namespace {

using journal::JournalTopic;

Vec3d read(const proto::Vec3& v) {
  return {v.x(), v.y(), v.z()};
}

class FrameReader {
 public:
  FrameReader(const SessionPart& part, const LessonFrameVisitor& visit, const NoteVisitor& note)
      : part_(part), visit_(visit), note_(note) {}

  Status run() {
    const auto report =
        part_.journal->read_all([this](std::string_view topic, Tick tick, BytesView bytes) {
          return take(topic, tick, bytes);
        });
    if (!status_) return status_;
    if (const auto status = report.status(); !status) note_(status.error().message);
    return {};
  }

 private:
  bool take(std::string_view topic, Tick tick, BytesView bytes) {
    const auto known = journal::topic_of(topic);
    if (!known) return true;
    const auto parse = [&](auto& message) {
      if (message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) return true;
      status_ = Error{ErrorCode::BadFile, fmt::format("{}: {} at tick {} is no message of its kind",
                                                      part_.path, topic, tick)};
      return false;
    };
    const auto follow = [&](auto message) {
      if (!parse(message)) return false;
      if (const auto wrong = surface_.check(message))
        note_(fmt::format("the surface at tick {} does not fit: {} is {}", tick, wrong->field,
                          wrong->recorded));
      return true;
    };
    switch (*known) {
      case JournalTopic::Topology:
        return follow(proto::SurfaceTopology());
      case JournalTopic::TopologyChange:
        return follow(proto::SurfaceChange());
      case JournalTopic::SurfaceKey:
      case JournalTopic::SurfaceDelta:
        return follow(proto::SurfaceFrame());
      case JournalTopic::Gap: {
        proto::JournalGap gap;
        if (!parse(gap)) return false;
        surface_.skip();
        if (!gap.is_join())
          note_("frames were dropped while recording: measures may differ from those told");
        return true;
      }
      case JournalTopic::Claims: {
        proto::ClaimLog log;
        if (!parse(log)) return false;
        for (const auto& event : log.event())
          if (event.tool() < kMaxTools) frame_.claims.push_back(event);
        return true;
      }
      case JournalTopic::FrameState: {
        proto::FrameState state;
        if (!parse(state)) return false;
        show(state);
        return true;
      }
      default:
        return true;
    }
  }

  void show(const proto::FrameState& state) {
    if (state.tick() > part_.until) return;
    tips_.clear();
    frame_.forces_n.clear();
    for (const auto& tool : state.tool()) {
      if (tool.tool() >= kMaxTools || tool.is_silent()) continue;
      const auto& tip = tool.has_proxy_position_m() ? tool.proxy_position_m() : tool.position_m();
      frame_.forces_n.push_back(read(tool.force_n()));
      tips_.push_back({.tool = ToolSlot{static_cast<std::uint8_t>(tool.tool())},
                       .position_m = read(tip),
                       .force_n = length(frame_.forces_n.back()),
                       .verb = static_cast<tool::Verb>(tool.verb()),
                       .has_claim = tool.has_claim()});
    }
    frame_.has_tools = state.tool_size() > 0;
    frame_.moment = {.tick = state.tick(),
                     .tips = tips_,
                     .displacements = surface_.surface(),
                     .layout = surface_.layout(),
                     .blood_m3 = {}};
    if (state.has_blood())
      frame_.moment.blood_m3 = static_cast<double>(state.blood().shed_nl()) * 1e-12;
    visit_(frame_);
    frame_.claims.clear();
  }

  const SessionPart& part_;
  const LessonFrameVisitor& visit_;
  const NoteVisitor& note_;
  StoredSurface surface_;
  std::vector<lesson::Tip> tips_;
  LessonFrame frame_;
  Status status_;
};

}  // namespace

Result<RecordedLesson> read_recorded_lesson(const SessionParts& session) {
  RecordedLesson out;
  Status status;
  std::string path;
  const auto visit = [&](Tick, const proto::LessonRecord& record) {
    out.has_left_out |= record.left_out() > 0;
    if (record.has_input()) out.inputs.push_back(record.input());
    if (record.has_stage()) out.told = record.stage();
    if (!record.has_lesson() || out.lesson) return true;
    auto lesson = lesson::read_lesson_text(record.lesson().source(), path + ": /lesson");
    if (!lesson) {
      status = lesson.error();
      return false;
    }
    for (const auto& picture : record.lesson().picture())
      if (status =
              lesson::add_picture(*lesson, {picture.name(), picture.image()}, path + ": /lesson");
          !status)
        return false;
    out.lesson = std::move(*lesson);
    return true;
  };
  for (const auto& part : session.parts) {
    path = part.path;
    if (auto s = part.journal->read_lessons(0, part.until, visit); !s) return s.error();
    if (!status) return status.error();
  }
  return out;
}

Status read_lesson_frames(const SessionParts& session, const LessonFrameVisitor& visit,
                          const NoteVisitor& note) {
  if (!session.missing.empty()) note(session.missing);
  for (const auto& part : session.parts)
    if (auto read = FrameReader(part, visit, note).run(); !read) return read;
  return {};
}

bool is_loss(const proto::ClaimEvent& event) {
  const auto outcome = static_cast<wire::ClaimOutcome>(event.outcome());
  return wire::is_refusal(outcome) || outcome == wire::ClaimOutcome::Slipped;
}

std::optional<lesson::Answer> apply(const proto::LessonInput& input, const lesson::Moment& moment,
                                    lesson::Course& course) {
  if (input.action() == proto::LESSON_ANSWER && input.tool() < kMaxTools)
    return course.answer(ToolSlot{static_cast<std::uint8_t>(input.tool())}, moment);
  if (input.action() == proto::LESSON_NEXT) course.skip();
  if (input.action() == proto::LESSON_RESTART) course.restart();
  return std::nullopt;
}

}  // namespace trocar::recording
