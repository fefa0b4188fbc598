#include "common/lesson/lesson.h"

#include <fmt/format.h>

#include <algorithm>

#include "common/math/tube.h"
#include "common/wire/lesson.h"

namespace trocar::lesson {
namespace {

struct MeasureText {
  const char* key;
  const char* words;
  const char* unit;
  double shown_per_unit;
  int digits;
};

constexpr std::array<MeasureText, kMeasures> kTexts{
    {{"time_s", "time", "s", 1, 1},
     {"peak_force_n", "greatest force", "N", 1, 2},
     {"mean_force_n", "mean force", "N", 1, 2},
     {"time_above_limit_s", "time with too much force", "s", 1, 1},
     {"path_m", "way of all tips", "m", 1, 2},
     {"wrong_answers", "wrong answers", "", 1, 0},
     {"error_mm", "mean distance from it", "mm", 1e3, 1},
     {"stray_wound_cm2", "cut beside the line", "cm²", 1e4, 2},
     {"missing_margin_mm", "margin too small by", "mm", 1e3, 1},
     {"volume_cm3", "taken out", "cm³", 1e6, 1},
     {"harm_cm2", "cut into what is to be spared", "cm²", 1e4, 2},
     {"refusals", "refused or lost grasps", "", 1, 0},
     {"blood_ml", "blood lost", "ml", 1e6, 1},
     {"drops", "let go elsewhere", "", 1, 0}}};

}  // namespace

const char* name_of(Goal goal) {
  constexpr std::array<const char*, kGoals> kNames{"find",   "follow", "lift", "hold",
                                                   "incise", "remove", "carry"};
  return kNames[static_cast<std::size_t>(goal)];
}

const char* key_of(Measure measure) {
  return kTexts[static_cast<std::size_t>(measure)].key;
}

const char* words_of(Measure measure) {
  return kTexts[static_cast<std::size_t>(measure)].words;
}

const char* unit_of(Measure measure) {
  return kTexts[static_cast<std::size_t>(measure)].unit;
}

double in_unit(Measure measure, double value) {
  return value * kTexts[static_cast<std::size_t>(measure)].shown_per_unit;
}

int digits_of(Measure measure) {
  return kTexts[static_cast<std::size_t>(measure)].digits;
}

std::string text_of(Measure measure, double value) {
  const std::string unit = unit_of(measure);
  const auto number = fmt::format("{:.{}f}", in_unit(measure, value), digits_of(measure));
  return unit.empty() ? number : number + " " + unit;
}

double Score::points(double value) const {
  return std::clamp((none - value) / (none - full), 0.0, 1.0);
}

double Structure::distance_m(const Vec3d& place_m) const {
  return distance_from_tube(place_m, from_m, to_m, radius_m);
}

const Structure* Lesson::find_structure(std::string_view name) const {
  const auto found = std::ranges::find(structures, name, &Structure::name);
  return found == structures.end() ? nullptr : &*found;
}

const Picture* Lesson::find_picture(std::string_view name) const {
  const auto found = std::ranges::find(pictures, name, &Picture::name);
  return found == pictures.end() ? nullptr : &*found;
}

Status add_picture(Lesson& lesson, Picture picture, std::string_view source) {
  const auto bad = [&](const std::string& why) {
    return Error{ErrorCode::BadFile, fmt::format("{}: picture {}: {}", source, picture.name, why)};
  };
  if (picture.bytes.size() > wire::kMostPictureBytes)
    return bad(
        fmt::format("has {} bytes, allowed are {}", picture.bytes.size(), wire::kMostPictureBytes));
  if (!picture.bytes.starts_with("\x89PNG\r\n\x1a\n") && !picture.bytes.starts_with("\xff\xd8\xff"))
    return bad("is neither a PNG nor a JPEG file");
  if (lesson.find_picture(picture.name) == nullptr) lesson.pictures.push_back(std::move(picture));
  return {};
}

}  // namespace trocar::lesson
