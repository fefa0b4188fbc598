#pragma once

// A lesson as its file says it: an organ with structures in it, and stages with a goal each. A file
// is TOML; docs/lessons.md lists the keys. Lengths are metres here and millimetres in the file.

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/math/vec3.h"

namespace trocar::lesson {

inline constexpr std::size_t kFileLimitBytes = 64 * 1024;
inline constexpr std::size_t kMostStages = 16, kMostStructures = 16, kMostScores = 12;
inline constexpr std::size_t kMostLinePoints = 32;
inline constexpr double kPascalPerMmHg = 133.322;

// Something in the organ that nobody sees: a ball, or a tube between two points with round ends.
struct Structure {
  std::string name;
  Vec3d from_m, to_m;  // at rest, world frame; equal: a ball
  double radius_m = 0.01;
  double young_modulus_pa = 30e3, poisson_ratio = 0.47;
  // Blood stands in it so, where the lesson bleeds; 0: it is no vessel. The flow feeds it at most.
  double vessel_pressure_pa = 0, vessel_flow_m3_s = 100e-6 / 60;

  // The distance of a place at rest from its surface, negative within.
  double distance_m(const Vec3d& place_m) const;
};

enum class Goal : std::uint8_t {
  Find,    // say where a structure is, with the tip on it
  Follow,  // keep the tip near a point that moves
  Lift,    // hold tissue and draw it away from where it was taken
  Hold,    // several hands hold tissue at the same time
  Incise,  // cut along a line, to a depth
  Remove,  // cut a structure out whole
  Carry,   // move a loose piece to a place
};
inline constexpr int kGoals = 7;
const char* name_of(Goal goal);

// These are measured in each stage, as docs/lessons.md defines it. Less is better in all of them.
enum class Measure : std::uint8_t {
  Time,           // s until the goal was reached
  PeakForce,      // N
  MeanForce,      // N, while a tool touches
  TimeAbove,      // s with a force above the stage's limit
  Path,           // m, of all tips
  WrongAnswers,   // places that were not it
  Error,          // m: of the answer, of the tip from the point, of the wound from the line
  StrayWound,     // m^2 of wound farther from the line than the tolerance
  MissingMargin,  // m by which the margin is less than wanted
  Volume,         // m^3 taken out
  Harm,           // m^2 of wound within structures that are to be spared
  Refusals,       // grasps and cuts that were refused, slipped or were lost
  Blood,          // m^3 lost
  Drops,          // times that a piece was let go elsewhere than at its place
};
inline constexpr int kMeasures = 14;
// "time_s": as in files.
const char* key_of(Measure measure);
// "greatest force".
const char* words_of(Measure measure);
// A number as people read it: "12.3 s", "4.1 mm".
std::string text_of(Measure measure, double value);
// Its unit there, "mm", empty for a count; a value in that unit, which is the key's; its digits.
const char* unit_of(Measure measure);
double in_unit(Measure measure, double value);
int digits_of(Measure measure);

// Points for a measure: all of them up to `full`, none from `none` on, linear between.
struct Score {
  Measure measure = Measure::Time;
  double full = 0, none = 1;          // in the measure's unit
  double points(double value) const;  // 0 to 1
};

struct Stage {
  std::string name, text, hint;
  std::string picture;  // its file's name, beside the lesson; empty: none
  double hint_after_s = 30;
  Goal goal = Goal::Find;
  double limit_s = 300;       // then the next stage begins
  double force_limit_n = 0;   // more is told and counted; 0: there is no limit
  std::string structure;      // to find or remove
  double tolerance_m = 0.01;  // of an answer, the tip, a wound beside the line, a piece's place
  double hold_s = 3;  // how long a point is followed, tissue lifted or held, a piece left alone
  double lift_m = 0.02;
  int hands = 1;           // that hold at the same time
  double depth_m = 0.005;  // of an incision
  double margin_m = 0;     // of what is removed, around the structure
  // The way of the point to follow, or the line to cut along, on the surface at rest; where a piece
  // is at rest, and where it is to be.
  std::vector<Vec3d> line_m;
  double lap_s = 10;               // the point's time along the line and back
  std::vector<std::string> spare;  // names of structures
  std::vector<Score> scores;
};

// A picture that people see beside what they are to do: a PNG or JPEG file, as it is.
struct Picture {
  std::string name, bytes;
};

struct Lesson {
  std::string title, text;
  std::string organ = "liver";  // a built-in one's name, or a file's path
  bool bleeds = false;
  std::vector<Structure> structures;
  std::vector<Stage> stages;      // 1 to kMostStages
  std::string source;             // the file's text, for recordings
  std::vector<Picture> pictures;  // that stages name, a name once

  // Null: there is no such structure.
  const Structure* find_structure(std::string_view name) const;
  const Picture* find_picture(std::string_view name) const;
};

// A lesson that the programs bring, by its name, or one's own, by its path.
Result<Lesson> find_lesson(const std::string& name_or_file);
// The names of those that the programs bring: "find-the-lump, follow-the-point".
std::string list_lessons();
// Errors are one line, with file, line and key.
Result<Lesson> read_lesson(const std::filesystem::path& file);
// Pictures are not read.
Result<Lesson> read_lesson_text(std::string_view text, std::string_view source);
// Error: it is too large, or no PNG or JPEG file; `source` begins the line.
Status add_picture(Lesson& lesson, Picture picture, std::string_view source);

}  // namespace trocar::lesson
