#include <set>

#include "common/base/nearest_word.h"
#include "common/lesson/lesson.h"
#include "common/lesson/lesson_texts.h"
#include "common/tool/toml_reader.h"
#include "common/wire/lesson.h"

namespace trocar::lesson {
namespace {

using tool::Document;
using tool::shown;
using tool::TableReader;

constexpr double kFarthestMm = 1000, kLongestS = 3600, kMostPoints = 1e6;
constexpr std::size_t kMostText = 500;  // bytes

constexpr std::array<std::pair<std::string_view, Goal>, kGoals> kGoalNames{
    {{"find", Goal::Find},
     {"follow", Goal::Follow},
     {"lift", Goal::Lift},
     {"hold", Goal::Hold},
     {"incise", Goal::Incise},
     {"remove", Goal::Remove},
     {"carry", Goal::Carry}}};

void read_length(TableReader& reader, std::string_view key, double& to_m, double least_mm,
                 double most_mm) {
  if (const auto mm = reader.number(key, least_mm, most_mm)) to_m = *mm * 1e-3;
}

void read_number(TableReader& reader, std::string_view key, double& to, double least, double most) {
  if (const auto value = reader.number(key, least, most)) to = *value;
}

std::string read_text(TableReader& reader, std::string_view key, bool is_required) {
  const auto text = reader.string(key);
  if (!text && is_required) reader.fail_missing(key, "say it in a sentence");
  if (text && text->size() > kMostText)
    reader.fail(key, "has " + std::to_string(text->size()) + " bytes, allowed are " +
                         std::to_string(kMostText));
  return text.value_or("");
}

std::optional<Vec3d> read_place(TableReader& reader, std::string_view key) {
  auto place = reader.vector(key);
  if (!place) return place;
  if (length(*place) > kFarthestMm)
    reader.fail(key, "is " + shown(length(*place)) + " mm from the organ's centre, allowed are " +
                         shown(kFarthestMm));
  return *place * 1e-3;
}

Structure read_structure(TableReader& reader) {
  Structure structure;
  structure.name = read_text(reader, "name", true);
  const auto centre = read_place(reader, "centre_mm");
  const auto from = read_place(reader, "from_mm"), to = read_place(reader, "to_mm");
  if (centre && (from || to))
    reader.fail("centre_mm", "makes a ball, and from_mm and to_mm a tube: write one of them");
  if (!centre && !(from && to))
    reader.fail("centre_mm", "is missing, write it for a ball, or from_mm and to_mm for a tube");
  structure.from_m = centre ? *centre : from.value_or(Vec3d{});
  structure.to_m = centre ? *centre : to.value_or(Vec3d{});
  if (!reader.has("radius_mm")) reader.fail_missing("radius_mm", "say how thick it is");
  read_length(reader, "radius_mm", structure.radius_m, 1, 100);
  read_number(reader, "young_modulus_pa", structure.young_modulus_pa, 100, 1e6);
  read_number(reader, "poisson_ratio", structure.poisson_ratio, 0, 0.49);
  if (const auto mmhg = reader.number("vessel_pressure_mmhg", 1, 300))
    structure.vessel_pressure_pa = *mmhg * kPascalPerMmHg;
  if (const auto flow = reader.number("vessel_flow_ml_min", 1, 5000)) {
    structure.vessel_flow_m3_s = *flow * 1e-6 / 60;
    if (structure.vessel_pressure_pa == 0)
      reader.fail("vessel_flow_ml_min", "is of a vessel, say vessel_pressure_mmhg as well");
  }
  reader.finish();
  return structure;
}

Score read_score(TableReader& reader) {
  Score score;
  const auto key = reader.string("measure");
  std::string names;
  bool is_known = false;
  for (int i = 0; i < kMeasures; ++i) {
    const auto measure = static_cast<Measure>(i);
    names += (names.empty() ? "" : ", ") + std::string(key_of(measure));
    if (key == key_of(measure)) score.measure = measure, is_known = true;
  }
  if (!is_known) reader.fail("measure", "is not one of " + names);
  const auto full = reader.number("full", 0, kMostPoints);
  const auto none = reader.number("none", 0, kMostPoints);
  if (!full) reader.fail_missing("full", "say up to where all points are given");
  if (!none) reader.fail_missing("none", "say from where on there are no points");
  if (full && none && !(*full < *none))
    reader.fail("none", "is " + shown(*none) + ", which has to be more than full");
  const double unit = 1 / in_unit(score.measure, 1);  // of the key
  score.full = full.value_or(0) * unit, score.none = none.value_or(1) * unit;
  reader.finish();
  return score;
}

void read_line(TableReader& reader, Stage& stage, Document& document) {
  const auto* node = reader.find("line_mm");
  if (node == nullptr) {
    reader.fail_missing("line_mm", "list the points, such as [[0, 60, 0], [20, 58, 0]]");
    return;
  }
  const auto* list = node->as_array();
  const auto wrong = [&] {
    reader.fail("line_mm", "is not a list of points, write [[x, y, z], ...]");
  };
  if (list == nullptr || list->size() < 2 || list->size() > kMostLinePoints) return wrong();
  for (const auto& item : *list) {
    const auto* numbers = item.as_array();
    if (numbers == nullptr || numbers->size() != 3) return wrong();
    std::array<double, 3> place{};
    for (std::size_t i = 0; i < 3; ++i) {
      const auto value = (*numbers)[i].value<double>();
      if (!value || !(std::abs(*value) <= kFarthestMm)) return wrong();
      place[i] = *value * 1e-3;
    }
    stage.line_m.push_back({place[0], place[1], place[2]});
  }
  double way = 0;
  for (std::size_t i = 1; i < stage.line_m.size(); ++i)
    way += length(stage.line_m[i] - stage.line_m[i - 1]);
  if (document.ok() && way < 1e-3) reader.fail("line_mm", "is shorter than a millimetre");
}

void read_way(TableReader& reader, Stage& stage) {
  const auto from = read_place(reader, "from_mm"), to = read_place(reader, "to_mm");
  if (!from) reader.fail_missing("from_mm", "say where the piece is at rest");
  if (!to) reader.fail_missing("to_mm", "say where its middle has to be");
  if (!from || !to) return;
  if (length(*from - *to) < 1e-3)
    reader.fail("to_mm", "is less than a millimetre from from_mm: nothing is to be carried");
  stage.line_m = {*from, *to};
}

void read_goal(TableReader& reader, Stage& stage, const Lesson& lesson, Document& document) {
  const auto is = [&](std::initializer_list<Goal> goals) {
    return std::ranges::find(goals, stage.goal) != goals.end();
  };
  const auto known = [&](const std::string& name, const char* key) {
    if (lesson.find_structure(name) == nullptr)
      reader.fail(key, "is \"" + name + "\", and no [[structure]] above has that name");
  };
  if (is({Goal::Find, Goal::Remove})) {
    stage.structure = read_text(reader, "structure", true);
    if (!stage.structure.empty()) known(stage.structure, "structure");
  }
  if (is({Goal::Find, Goal::Follow, Goal::Incise, Goal::Carry}))
    read_length(reader, "tolerance_mm", stage.tolerance_m, 0.5, 100);
  if (is({Goal::Follow, Goal::Lift, Goal::Hold, Goal::Carry}))
    read_number(reader, "hold_s", stage.hold_s, 0.1, kLongestS);
  if (is({Goal::Follow, Goal::Incise})) read_line(reader, stage, document);
  if (is({Goal::Follow})) read_number(reader, "lap_s", stage.lap_s, 1, kLongestS);
  if (is({Goal::Lift})) read_length(reader, "lift_mm", stage.lift_m, 1, 500);
  if (is({Goal::Carry})) read_way(reader, stage);
  if (is({Goal::Hold, Goal::Carry}))
    if (const auto hands = reader.integer("hands", 1, 16)) stage.hands = static_cast<int>(*hands);
  if (is({Goal::Incise})) read_length(reader, "depth_mm", stage.depth_m, 0.5, 100);
  if (is({Goal::Remove})) read_length(reader, "margin_mm", stage.margin_m, 0, 50);
  if (is({Goal::Incise, Goal::Remove}))
    for (const auto& name : reader.strings("spare").value_or(std::vector<std::string>{})) {
      known(name, "spare");
      stage.spare.push_back(name);
    }
}

Stage read_stage(TableReader& reader, const Lesson& lesson, Document& document,
                 const std::string& path) {
  Stage stage;
  stage.name = read_text(reader, "name", true);
  stage.text = read_text(reader, "text", true);
  stage.hint = read_text(reader, "hint", false);
  stage.picture = read_text(reader, "picture", false);
  if (stage.picture.find('/') != std::string::npos || stage.picture.starts_with('.'))
    reader.fail("picture",
                "is \"" + stage.picture +
                    "\", write the name of a file beside the lesson's, without a folder");
  read_number(reader, "hint_after_s", stage.hint_after_s, 0, kLongestS);
  read_number(reader, "limit_s", stage.limit_s, 1, kLongestS);
  read_number(reader, "force_limit_n", stage.force_limit_n, 0.05, 100);
  const auto goal = reader.choice("goal", kGoalNames);
  if (!reader.has("goal")) reader.fail_missing("goal", "write \"find\" or another one");
  if (!document.ok()) return stage;
  stage.goal = *goal;
  read_goal(reader, stage, lesson, document);
  for (const auto* entry : reader.tables("score")) {
    TableReader score(document, *entry,
                      path + ".score[" + std::to_string(stage.scores.size()) + "]");
    if (stage.scores.size() == kMostScores)
      score.fail("", "is one too many, there may be " + std::to_string(kMostScores));
    if (!document.ok()) return stage;
    stage.scores.push_back(read_score(score));
  }
  reader.finish();
  return stage;
}

template <typename T>
bool is_full(TableReader& reader, const std::vector<T>& list, std::size_t most) {
  if (list.size() < most) return false;
  reader.fail("", "is one too many, there may be " + std::to_string(most));
  return true;
}

}  // namespace

Result<Lesson> read_lesson_text(std::string_view text, std::string_view source) {
  Document document(source);
  const auto table = tool::parse_toml(document, text, source, kFileLimitBytes, "lesson",
                                      "common/lesson/lessons/find-the-lump.toml");
  if (!table) return document.error();
  TableReader root(document, *table, "");
  Lesson lesson;
  lesson.title = read_text(root, "title", true);
  lesson.text = read_text(root, "text", true);
  if (const auto organ = root.string("organ")) lesson.organ = *organ;
  lesson.bleeds = root.boolean("bleeding").value_or(false);
  for (const auto* entry : root.tables("structure")) {
    TableReader reader(document, *entry,
                       "structure[" + std::to_string(lesson.structures.size()) + "]");
    if (is_full(reader, lesson.structures, kMostStructures)) break;
    auto structure = read_structure(reader);
    if (lesson.find_structure(structure.name) != nullptr)
      reader.fail("name", "is that of another one above, choose a different one");
    lesson.structures.push_back(std::move(structure));
  }
  for (const auto* entry : root.tables("stage")) {
    const auto path = "stage[" + std::to_string(lesson.stages.size()) + "]";
    TableReader reader(document, *entry, path);
    if (is_full(reader, lesson.stages, kMostStages)) break;
    lesson.stages.push_back(read_stage(reader, lesson, document, path));
    if (!document.ok()) break;
  }
  if (lesson.stages.empty()) root.fail("stage", "is missing, add a [[stage]] with a goal");
  root.finish();
  if (!document.ok()) return document.error();
  lesson.source = std::string(text);
  return lesson;
}

namespace {

// find(name): a picture's bytes, or why there are none.
template <typename Find>
Result<Lesson> with_pictures(Result<Lesson> lesson, const std::string& source, Find find) {
  if (!lesson) return lesson;
  for (const auto& stage : lesson->stages) {
    if (stage.picture.empty()) continue;
    Result<std::string> bytes = find(stage.picture);
    if (!bytes) return bytes.error();
    if (auto added = add_picture(*lesson, {stage.picture, std::move(*bytes)}, source); !added)
      return added.error();
  }
  return lesson;
}

}  // namespace

Result<Lesson> find_lesson(const std::string& name_or_file) {
  for (const auto& [name, text] : lesson_texts()) {
    if (name != name_or_file) continue;
    const auto source = name + ".toml";
    return with_pictures(read_lesson_text(text, source), source,
                         [&](const std::string& wanted) -> Result<std::string> {
                           for (const auto& picture : lesson_pictures())
                             if (picture.name == wanted) return std::string(picture.bytes);
                           return Error{ErrorCode::ResourceMissing,
                                        source + ": picture " + wanted + ": is not there"};
                         });
  }
  if (name_or_file.find_first_of("./") == std::string::npos) {
    std::vector<std::string> names;
    for (const auto& [name, text] : lesson_texts()) names.push_back(name);
    const auto meant = did_you_mean(name_or_file, names);
    return Error{ErrorCode::Usage, "there is no lesson \"" + name_or_file + "\"" +
                                       (meant.empty() ? "." : meant) + " The lessons are " +
                                       list_lessons() + "; or name a file"};
  }
  return read_lesson(name_or_file);
}

std::string list_lessons() {
  std::string names;
  for (const auto& [name, text] : lesson_texts()) names += (names.empty() ? "" : ", ") + name;
  return names;
}

Result<Lesson> read_lesson(const std::filesystem::path& file) {
  const auto text = tool::read_text_file(file, kFileLimitBytes, "lesson");
  if (!text) return text.error();
  return with_pictures(read_lesson_text(*text, file.string()), file.string(),
                       [&](const std::string& wanted) {
                         return tool::read_text_file(file.parent_path() / wanted,
                                                     wire::kMostPictureBytes, "picture");
                       });
}

}  // namespace trocar::lesson
