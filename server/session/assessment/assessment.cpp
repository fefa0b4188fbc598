#include "server/session/assessment/assessment.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>

#include "common/base/printable.h"
#include "common/wire/claim_outcome.h"
#include "server/session/assessment/hand_meter.h"
#include "server/session/recording/lesson_frames.h"
#include "server/session/recording/pseudonyms.h"

namespace trocar::assessment {
namespace {

constexpr double kCurvePeriodS = 0.25;
constexpr Tick kHarmPeriod = 1000;  // ticks between two moments of harm that are told

// Reads a recording frame by frame, and measures as it goes.
class Assessor {
 public:
  Assessor(const recording::SessionParts& session, const Options& options, Assessment& out)
      : session_(session), options_(options), out_(out) {}

  Status run() {
    if (auto s = read_people(); !s) return s;
    if (auto s = read_lesson(); !s) return s;
    out_.whole.name = "Whole session";
    out_.whole.begin = session_.parts.front().journal->info().begin_tick();
    whole_.limit_n = options_.force_limit_n;
    begin_stage(out_.whole.begin);
    const auto read = recording::read_lesson_frames(
        session_, [this](const recording::LessonFrame& frame) { observe(frame); },
        [this](std::string note) { note_once(std::move(note)); });
    if (!read) return read;
    finish();
    return {};
  }

 private:
  // A time with a force above the stage's limit.
  struct Excess {
    Tick begin = 0, peak = 0;
    double peak_n = 0;
    std::string person;
  };

  Status read_people() {
    const auto visit = [&](Tick tick, const proto::Participants& list) {
      for (const auto& entry : list.participant())
        people_[entry.slot()][tick] = printable(entry.name(), 64);
      return true;
    };
    for (const auto& part : session_.parts)
      if (auto read = part.journal->read_participants(0, part.until, visit); !read) return read;
    return {};
  }

  Status read_lesson() {
    auto lesson = recording::read_recorded_lesson(session_);
    if (!lesson) return lesson.error();
    if (lesson->has_left_out)
      out_.notes.push_back("the recording had no room for some of what the lesson told");
    recorded_ = std::move(*lesson);
    if (!recorded_.lesson) return {};
    out_.lesson = *recorded_.lesson;
    course_.emplace(*recorded_.lesson);
    return {};
  }

  const std::string& person_of(ToolSlot tool, Tick tick) {
    static const std::string kNobody;
    const auto lists = people_.find(tool.value / kToolsPerHand);
    if (lists == people_.end()) return kNobody;
    const auto next = lists->second.upper_bound(tick);
    return next == lists->second.begin() ? next->second : std::prev(next)->second;
  }

  void note_once(std::string note) {
    if (std::ranges::find(out_.notes, note) == out_.notes.end() && out_.notes.size() < kMostMoments)
      out_.notes.push_back(std::move(note));
  }

  void tell(Tick tick, const std::string& person, const std::string& text) {
    for (auto* part : {&stage_, &out_.whole}) {
      if (part->moments.size() < kMostMoments)
        part->moments.push_back({tick, person, text});
      else
        ++part->moments_left_out;
    }
  }

  void observe(const recording::LessonFrame& frame) {
    const Tick tick = frame.moment.tick;
    if (course_ && !has_begun_ && frame.has_tools) {
      has_begun_ = true;
      begin_stage(tick);
    }
    for (std::size_t i = 0; i < frame.moment.tips.size(); ++i) {
      const auto& tip = frame.moment.tips[i];
      const auto& person = person_of(tip.tool, tick);
      hands_.add(tip.tool, person, tick, tip.position_m, frame.forces_n[i]);
      whole_.add(tip.tool, person, tick, tip.position_m, frame.forces_n[i]);
      add_to_curve(tip.tool, person, tick, tip.position_m, tip.force_n);
    }
    add_to_blood(frame.moment);
    take_claims(frame);
    if (has_begun_) observe_lesson(frame.moment);
    last_tick_ = tick;
  }

  void take_claims(const recording::LessonFrame& frame) {
    const Tick tick = frame.moment.tick;
    for (const auto& event : frame.claims) {
      const auto tool = ToolSlot{static_cast<std::uint8_t>(event.tool())};
      const auto outcome = static_cast<wire::ClaimOutcome>(event.outcome());
      hands_.note(tool, static_cast<tool::Verb>(event.verb()), outcome, event.tick());
      whole_.note(tool, static_cast<tool::Verb>(event.verb()), outcome, event.tick());
      if (!recording::is_loss(event)) continue;
      if (has_begun_) course_->note_refusal();
      tell(event.tick(), person_of(tool, tick),
           outcome == wire::ClaimOutcome::Slipped       ? "tissue slipped out of the grasp"
           : outcome == wire::ClaimOutcome::RefusedHeld ? "was refused what somebody else holds"
                                                        : "took hold of nothing");
    }
    for (auto* meter : {&hands_, &whole_}) meter->end_waits(frame.moment.tips, tick);
  }

  void observe_lesson(const lesson::Moment& moment) {
    const auto before = course_->results().size();
    const bool is_over = course_->is_over();
    course_->observe(moment);
    if (!is_over && course_->results().size() == before) note_losses(moment);
    end_stages(before, moment.tick);
    for (; next_input_ < recorded_.inputs.size() &&
           recorded_.inputs[next_input_].tick() <= moment.tick;
         ++next_input_)
      apply(recorded_.inputs[next_input_], moment);
  }

  void apply(const proto::LessonInput& input, const lesson::Moment& moment) {
    const auto before = course_->results().size();
    const auto answer = recording::apply(input, moment, *course_);
    if (answer == lesson::Answer::Wrong)
      tell(moment.tick, person_of(ToolSlot{static_cast<std::uint8_t>(input.tool())}, moment.tick),
           "gave a wrong answer");
    if (input.action() != proto::LESSON_RESTART) return end_stages(before, moment.tick);
    excess_.reset();
    out_.stages.clear();
    out_.notes.push_back(
        fmt::format("the lesson was begun anew at {:.1f} s: stages are those after it",
                    seconds_of(moment.tick)));
    begin_stage(moment.tick);
  }

  // Tells once of each time that a limit of the lesson was passed.
  void note_losses(const lesson::Moment& moment) {
    const Tick tick = moment.tick;
    if (course_->is_too_strong()) {
      const auto strongest = std::ranges::max_element(moment.tips, {}, &lesson::Tip::force_n);
      if (!excess_) excess_ = Excess{.begin = tick};
      if (strongest->force_n > excess_->peak_n)
        excess_->peak_n = strongest->force_n, excess_->peak = tick,
        excess_->person = person_of(strongest->tool, tick);
    } else {
      end_excess(tick);
    }
    if (course_->harm_m2() <= harm_m2_ || tick - harm_tick_ < kHarmPeriod) return;
    harm_m2_ = course_->harm_m2(), harm_tick_ = tick;
    tell(tick, "", fmt::format("{:.2f} cm² of what is to be spared is cut", harm_m2_ * 1e4));
  }

  void end_excess(Tick tick) {
    if (!excess_) return;
    tell(excess_->peak, excess_->person,
         fmt::format("passed the limit of force for {:.1f} s, {:.1f} N at this moment",
                     seconds_of(tick - excess_->begin), excess_->peak_n));
    excess_.reset();
  }

  void begin_stage(Tick tick) {
    stage_ = {};
    stage_.begin = stage_.end = tick;
    hands_ = {};
    harm_m2_ = 0, harm_tick_ = 0;
    if (!course_ || course_->is_over()) return;
    stage_.stage = course_->stage_number();
    stage_.name = course_->stage().name;
    const double limit_n = course_->stage().force_limit_n;
    hands_.limit_n = limit_n > 0 ? limit_n : options_.force_limit_n;
  }

  void end_stages(std::size_t before, Tick tick) {
    if (course_->results().size() == before) return;
    stage_.result = course_->results().back();
    end_part(tick);
    begin_stage(tick);
  }

  void end_part(Tick tick) {
    end_excess(tick);
    stage_.end = tick;
    stage_.hands = hands_.hands();
    out_.stages.push_back(std::move(stage_));
  }

  void add_to_curve(ToolSlot tool, const std::string& person, Tick tick, const Vec3d& tip,
                    double newton) {
    const double time_s = seconds_of(tick);
    auto [found, is_new] = curves_.try_emplace(tool.value);
    auto& curve = found->second;
    if (is_new) curve.tool = tool, curve.person = person;
    if (curve.time_s.empty() || time_s - curve.time_s.back() >= kCurvePeriodS) {
      curve.time_s.push_back(time_s);
      curve.force_n.push_back(newton);
      curve.tip_m.push_back(tip);
    }
    curve.force_n.back() = std::max(curve.force_n.back(), newton);
  }

  void add_to_blood(const lesson::Moment& moment) {
    auto& [time_s, lost_ml] = out_.blood;
    const double now_s = seconds_of(moment.tick);
    if (!moment.blood_m3 || (!time_s.empty() && now_s - time_s.back() < kCurvePeriodS)) return;
    time_s.push_back(now_s);
    lost_ml.push_back(*moment.blood_m3 * 1e6);
  }

  void finish() {
    if (has_begun_ && !course_->is_over() && last_tick_ > stage_.begin) end_part(last_tick_);
    out_.whole.end = last_tick_;
    out_.whole.hands = whole_.hands();
    for (auto& [tool, curve] : curves_) out_.curves.push_back(std::move(curve));
    if (!course_) return;
    out_.is_over = course_->is_over();
    out_.points = course_->points();
    if (!has_begun_) out_.notes.push_back("the lesson did not begin: nobody had a tool");
    compare_with_told();
  }

  // People were told of results as they came; the recording must give the same again.
  void compare_with_told() {
    if (!recorded_.told) return;
    const auto& results = course_->results();
    bool is_same = static_cast<std::size_t>(recorded_.told->result_size()) == results.size();
    for (std::size_t i = 0; is_same && i < results.size(); ++i) {
      const auto& told = recorded_.told->result(static_cast<int>(i));
      is_same = told.is_reached() == results[i].is_reached &&
                std::abs(told.points() - results[i].points) < 0.01;
    }
    if (!is_same)
      out_.notes.push_back(
          fmt::format("people were told of {} stages with {:.1f} points, the recording gives {} "
                      "with {:.1f}",
                      recorded_.told->result_size(), recorded_.told->points(), results.size(),
                      course_->points()));
  }

  const recording::SessionParts& session_;
  const Options& options_;
  Assessment& out_;
  std::map<std::uint32_t, std::map<Tick, std::string>> people_;  // by slot, from a tick on
  std::optional<lesson::Course> course_;
  recording::RecordedLesson recorded_;
  std::size_t next_input_ = 0;
  bool has_begun_ = false;
  Part stage_;
  HandMeter hands_, whole_;  // of the stage, of the session
  std::map<std::uint8_t, Curve> curves_;
  std::optional<Excess> excess_;  // that goes on
  double harm_m2_ = 0;
  Tick harm_tick_ = 0, last_tick_ = 0;
};

}  // namespace

const std::string& file_at(const Assessment& session, Tick tick) {
  if (session.earlier.empty() || tick > session.file_begin) return session.file;
  const std::string* file = &session.earlier.front().file;
  for (const auto& part : session.earlier)
    if (part.begin < tick) file = &part.file;
  return *file;
}

Result<Assessment> assess(const std::string& path, const Options& options) {
  const auto session = recording::open_session_parts(path);
  if (!session) return session.error();
  Assessment out;
  out.file = path;
  out.name = std::filesystem::path(path).filename().string();
  const auto& first = session->parts.front().journal->info();
  for (const auto& part : session->parts)
    if (&part == &session->parts.back())
      out.file_begin = part.journal->info().begin_tick();
    else
      out.earlier.push_back({part.journal->info().begin_tick(), part.path});
  out.organ = first.organ_name;
  out.start_utc_ns = first.start_utc_ns;
  if (auto s = Assessor(*session, options, out).run(); !s) return s.error();
  if (!session->parts.back().journal->info().is_finished)
    out.notes.push_back("the recording was cut short: what came after its end is not here");
  return out;
}

void give_pseudonyms(std::vector<Assessment>& sessions) {
  recording::Pseudonyms pseudonyms;
  const auto pseudonym_of = [&](const std::string& name) {
    pseudonyms.add(name);
    return pseudonyms.of_name(name);
  };
  for (auto& session : sessions) {
    for (auto& curve : session.curves) curve.person = pseudonym_of(curve.person);
    const auto hide = [&](Part& part) {
      for (auto& hand : part.hands) hand.person = pseudonym_of(hand.person);
      for (auto& moment : part.moments) moment.person = pseudonym_of(moment.person);
    };
    for (auto& stage : session.stages) hide(stage);
    hide(session.whole);
  }
}

}  // namespace trocar::assessment
