#pragma once

// The course of a lesson: from what a session publishes frame by frame to goals that are reached
// and points. The server runs it while people learn, and trocar-journal over a recording: the same
// frames, answers and orders give the same results. Time is simulated time. Nothing that a client
// claims goes in, but where its tools are and that it answers.

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/base/ids.h"
#include "common/base/tick.h"
#include "common/lesson/lesson.h"
#include "common/lesson/wound.h"
#include "common/tool/tool.h"

namespace trocar::lesson {

// A tool as a frame has it.
struct Tip {
  ToolSlot tool;
  Vec3d position_m;  // world frame
  double force_n = 0;
  tool::Verb verb = tool::Verb::None;
  bool has_claim = false;  // its push, grasp or cut is in effect
};

// A moment is what one frame shows. The layout is that of the frame's epoch.
struct Moment {
  Tick tick = 0;
  std::span<const Tip> tips;  // by slot
  std::span<const wire::QuantisedVertex> displacements;
  const wire::SurfaceLayout* layout = nullptr;
  std::optional<double> blood_m3;  // lost since the session began; nothing: it does not bleed
};

struct StageResult {
  bool is_reached = false;
  Tick begin = 0, end = 0;
  std::array<double, kMeasures> values;  // by Measure; not a number: not measured
  double points = 0;                     // 0 to 100

  double value(Measure measure) const { return values[static_cast<std::size_t>(measure)]; }
};

// Says what was measured, a line each for people: "greatest force: 2.10 N".
std::vector<std::string> lines_of(const StageResult& result);

// An answer is somebody's word on where it is; this became of it.
enum class Answer : std::uint8_t { NotAsked, NoTissue, Wrong, Right };

class Course {
 public:
  explicit Course(Lesson lesson);
  ~Course();
  Course(Course&&) noexcept;
  Course& operator=(Course&&) noexcept;

  // In order of ticks. True: a stage is over, or the lesson.
  bool observe(const Moment& moment);
  // A hand says that it is here, with its tip as it was in `moment`, the newest.
  Answer answer(ToolSlot tool, const Moment& moment);
  // A grasp or cut was refused, slipped or was lost.
  void note_refusal();
  // The instructor goes on to the next stage, whose goal counts as not reached.
  void skip();
  void restart();

  const Lesson& lesson() const { return lesson_; }
  bool is_over() const { return results_.size() == lesson_.stages.size(); }
  // The stage that is on; of a lesson that is over, the last one.
  std::size_t stage_number() const;
  const Stage& stage() const { return lesson_.stages[stage_number()]; }
  Tick begin() const { return begin_; }
  double seconds() const;                        // since then
  double progress() const { return progress_; }  // of its goal, 0 to 1
  bool shows_hint() const;
  bool is_too_strong() const { return is_too_strong_; }  // in the newest frame
  // Returns the wound within what is to be spared, m^2, of the stage so far as it was last looked
  // at.
  double harm_m2() const;
  // Returns where the point to follow is, or a piece has to be; nothing: there is none.
  std::optional<Vec3d> target_m() const;
  const std::vector<StageResult>& results() const { return results_; }  // of stages that are over
  double points() const;                                                // mean of all stages so far

 private:
  struct Meter;

  void begin_stage(Tick tick);
  void end_stage(bool is_reached);
  void measure(const Moment& moment, double dt_s);
  void look_at_wound(const Moment& moment);
  bool is_reached(const Moment& moment, double dt_s);
  bool follows(const Moment& moment, double dt_s);
  bool lifts(const Moment& moment, double dt_s);
  bool holds(const Moment& moment, double dt_s);
  bool carries(const Moment& moment, double dt_s);

  Lesson lesson_;
  std::vector<StageResult> results_;
  std::optional<Tick> tick_;  // of the newest frame
  Tick begin_ = 0;            // of the stage
  double progress_ = 0;
  bool is_too_strong_ = false;
  std::unique_ptr<Meter> meter_;  // of the stage
};

}  // namespace trocar::lesson
