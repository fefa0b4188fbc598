#include "server/session/recording/recorded_course.h"

#include <limits>
#include <utility>
#include <vector>

#include "common/journal/session_journal.h"
#include "common/wire/claim_outcome.h"
#include "proto/journal.pb.h"
#include "proto/wire.pb.h"
#include "server/session/recording/stored_surface.h"

namespace trocar::recording {
namespace {

using journal::JournalTopic;

constexpr Tick kAll = std::numeric_limits<Tick>::max();

Vec3d read(const proto::Vec3& v) {
  return {v.x(), v.y(), v.z()};
}

class CourseReader {
 public:
  CourseReader(std::string path, lesson::Course course, std::vector<proto::LessonInput> inputs)
      : path_(std::move(path)), course_(std::move(course)), inputs_(std::move(inputs)) {}

  Result<lesson::Course> run(journal::SessionJournal& journal) {
    journal.read_all([this](std::string_view topic, Tick tick, BytesView bytes) {
      return take(topic, tick, bytes);
    });
    if (!status_) return status_.error();
    return std::move(course_);
  }

 private:
  template <typename Message>
  bool parse(BytesView bytes, Tick tick, Message& message) {
    if (message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) return true;
    status_ = Error{ErrorCode::BadFile,
                    path_ + ": tick " + std::to_string(tick) + " has a damaged message"};
    return false;
  }
  template <typename Message>
  bool follow(BytesView bytes, Tick tick) {
    Message message;
    if (!parse(bytes, tick, message)) return false;
    (void)surface_.check(message);
    return true;
  }

  bool take(std::string_view topic, Tick tick, BytesView bytes) {
    const auto known = journal::topic_of(topic);
    if (!known) return true;
    switch (*known) {
      case JournalTopic::Topology:
        return follow<proto::SurfaceTopology>(bytes, tick);
      case JournalTopic::TopologyChange:
        return follow<proto::SurfaceChange>(bytes, tick);
      case JournalTopic::SurfaceKey:
      case JournalTopic::SurfaceDelta:
        return follow<proto::SurfaceFrame>(bytes, tick);
      case JournalTopic::Claims: {
        proto::ClaimLog log;
        if (!parse(bytes, tick, log)) return false;
        for (const auto& event : log.event()) {
          const auto outcome = static_cast<wire::ClaimOutcome>(event.outcome());
          losses_ += wire::is_refusal(outcome) || outcome == wire::ClaimOutcome::Slipped;
        }
        return true;
      }
      case JournalTopic::FrameState: {
        proto::FrameState state;
        if (!parse(bytes, tick, state)) return false;
        observe(state);
        return true;
      }
      default:
        return true;
    }
  }

  // A lesson begins when somebody with a tool is there.
  void observe(const proto::FrameState& state) {
    const int losses = std::exchange(losses_, 0);
    has_begun_ |= state.tool_size() > 0;
    if (!has_begun_) return;
    for (int i = 0; i < losses; ++i) course_.note_refusal();
    tips_.clear();
    for (const auto& tool : state.tool()) {
      if (tool.tool() >= kMaxTools || tool.is_silent()) continue;
      const auto& tip = tool.has_proxy_position_m() ? tool.proxy_position_m() : tool.position_m();
      tips_.push_back({.tool = ToolSlot{static_cast<std::uint8_t>(tool.tool())},
                       .position_m = read(tip),
                       .force_n = length(read(tool.force_n())),
                       .verb = static_cast<tool::Verb>(tool.verb()),
                       .has_claim = tool.has_claim()});
    }
    lesson::Moment moment{.tick = state.tick(),
                          .tips = tips_,
                          .displacements = surface_.surface(),
                          .layout = surface_.layout(),
                          .blood_m3 = {}};
    if (state.has_blood()) moment.blood_m3 = static_cast<double>(state.blood().shed_nl()) * 1e-12;
    course_.observe(moment);
    for (; next_input_ < inputs_.size() && inputs_[next_input_].tick() <= moment.tick;
         ++next_input_)
      apply(inputs_[next_input_], moment);
  }

  void apply(const proto::LessonInput& input, const lesson::Moment& moment) {
    if (input.action() == proto::LESSON_ANSWER && input.tool() < kMaxTools)
      (void)course_.answer(ToolSlot{static_cast<std::uint8_t>(input.tool())}, moment);
    if (input.action() == proto::LESSON_NEXT) course_.skip();
    if (input.action() == proto::LESSON_RESTART) course_.restart();
  }

  const std::string path_;
  lesson::Course course_;
  const std::vector<proto::LessonInput> inputs_;
  std::size_t next_input_ = 0;
  StoredSurface surface_;
  std::vector<lesson::Tip> tips_;
  int losses_ = 0;  // of the frame that comes
  bool has_begun_ = false;
  Status status_;
};

}  // namespace

Result<std::optional<lesson::Course>> recorded_course(journal::SessionJournal& journal,
                                                      const std::string& path) {
  std::optional<lesson::Lesson> lesson;
  std::vector<proto::LessonInput> inputs;
  Status status;
  const auto visit = [&](Tick, const proto::LessonRecord& record) {
    if (record.has_input()) inputs.push_back(record.input());
    if (!record.has_lesson() || lesson) return true;
    auto found = lesson::read_lesson_text(record.lesson().source(), path + ": /lesson");
    if (!found) {
      status = found.error();
      return false;
    }
    lesson = std::move(*found);
    return true;
  };
  if (const auto all = journal.read_lessons(0, kAll, visit); !all) return all.error();
  if (!status) return status.error();
  if (!lesson) return std::optional<lesson::Course>();
  auto course =
      CourseReader(path, lesson::Course(*std::move(lesson)), std::move(inputs)).run(journal);
  if (!course) return course.error();
  return std::optional<lesson::Course>(std::move(*course));
}

}  // namespace trocar::recording
