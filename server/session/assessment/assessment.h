#pragma once

// An assessment measures what people did in a recorded session, by stages of its lesson and as a
// whole. It needs the recording alone, and simulates nothing: the lesson's course sees the recorded
// frames again, as the server's did. docs/assessment.md defines each measure.

#include <optional>
#include <string>
#include <vector>

#include "common/base/ids.h"
#include "common/base/result.h"
#include "common/base/tick.h"
#include "common/lesson/course.h"
#include "common/lesson/skill.h"

namespace trocar::assessment {

inline double seconds_of(Tick ticks) {
  return static_cast<double>(ticks) / static_cast<double>(kTicksPerSecond);
}

// A hand is one tool, over a stage or the session.
struct Hand {
  ToolSlot tool;
  std::string person;  // printable
  lesson::Skill skill;
  int grasps = 0, cuts = 0;  // that were granted
  int refusals = 0;          // grasps and cuts that were refused
  int losses = 0;            // grasps out of which the tissue slipped
  double waited_s = 0;       // that it asked for tissue which somebody else held
};

// Something that cost points or harmed tissue.
struct Moment {
  Tick tick = 0;
  std::string person;  // whose tool it was; empty: anybody's
  std::string text;    // one line
};

// A part is a stage, or the whole session.
struct Part {
  std::string name;
  Tick begin = 0, end = 0;
  std::optional<std::size_t> stage;           // its number in the lesson
  std::optional<lesson::StageResult> result;  // of a stage
  std::vector<Hand> hands;                    // by tool
  std::vector<Moment> moments;                // at most kMostMoments, by tick
  std::size_t moments_left_out = 0;

  double seconds() const { return seconds_of(end - begin); }
};
inline constexpr std::size_t kMostMoments = 50;

// A curve is of one tool, four times a second.
struct Curve {
  ToolSlot tool;
  std::string person;
  std::vector<double> time_s;
  std::vector<double> force_n;  // the greatest since the sample before
  std::vector<Vec3d> tip_m;     // world frame
};

// Tissue that was strained beyond what it bears, at any time of the session.
struct StrainDamage {
  double limit = 0;  // strain
  double volume_m3 = 0;
  struct Part {
    std::string structure;
    double volume_m3 = 0;
  };
  std::vector<Part> structures;  // of the lesson
  double greatest = 0;           // strain
  Tick greatest_tick = 0;
  double cut_m2 = 0, torn_m2 = 0;  // of wound, one side, at rest: by blades, and by pulling
};

// Blood lost since the session began, four times a second; empty where nothing bleeds.
struct BloodCurve {
  std::vector<double> time_s, lost_ml;
};

struct Assessment {
  std::string file, organ;
  std::string name;  // of the file, as reports and tables call it
  // A session that went on after a crash has earlier recordings, each from a tick on.
  struct Earlier {
    Tick begin = 0;
    std::string file;
  };
  std::vector<Earlier> earlier;  // in order of time
  Tick file_begin = 0;           // of `file`
  std::uint64_t start_utc_ns = 0;
  std::optional<lesson::Lesson> lesson;  // nothing: the session gave none
  bool is_over = false;                  // its last stage
  double points = 0;                     // mean of the stages that are over
  std::vector<Part> stages;              // that are over; the last one may not be
  Part whole;
  std::vector<Curve> curves;  // by tool
  BloodCurve blood;
  std::optional<StrainDamage> strain;
  std::vector<std::string> notes;  // why not everything could be measured, a line each
};

// Returns the recording that has the tick.
const std::string& file_at(const Assessment& session, Tick tick);

struct Options {
  double force_limit_n = 2;  // of what is told as time above the limit where a stage has none
};

// Errors: the file cannot be read, or its lesson is none.
Result<Assessment> assess(const std::string& journal, const Options& options);

// Puts "Person 1" and so on in the place of names: the same name has the same one.
void give_pseudonyms(std::vector<Assessment>& sessions);

}  // namespace trocar::assessment
