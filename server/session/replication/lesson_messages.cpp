#include "server/session/replication/lesson_messages.h"

#include <fmt/format.h>

#include <cmath>

#include "proto/wire.pb.h"

namespace trocar::replication {
namespace {

void write(const Vec3d& place, proto::Vec3& message) {
  message.set_x(static_cast<float>(place.x));
  message.set_y(static_cast<float>(place.y));
  message.set_z(static_cast<float>(place.z));
}

void write(const lesson::Stage& stage, const lesson::StageResult& result,
           proto::LessonResult& message) {
  message.set_name(stage.name);
  message.set_is_reached(result.is_reached);
  message.set_seconds(static_cast<float>(result.value(lesson::Measure::Time)));
  message.set_points(static_cast<float>(result.points));
  for (const auto& line : lesson::lines_of(result)) message.add_line(line);
}

}  // namespace

std::optional<bleeding::Rules> bleeding_rules(const lesson::Lesson* lesson, bool is_asked_for) {
  if (!is_asked_for && !(lesson && lesson->bleeds)) return {};
  bleeding::Rules rules;
  if (!lesson) return rules;
  for (const auto& structure : lesson->structures)
    if (structure.vessel_pressure_pa > 0)
      rules.vessels.push_back({.name = structure.name,
                               .from_m = structure.from_m,
                               .to_m = structure.to_m,
                               .radius_m = structure.radius_m,
                               .pressure_pa = structure.vessel_pressure_pa,
                               .most_flow_m3_s = structure.vessel_flow_m3_s});
  return rules;
}

lesson::Moment moment_of(const step::PublishedFrame& frame, const wire::SurfaceLayout& layout,
                         std::vector<lesson::Tip>& tips) {
  tips.clear();
  for (const auto& tool : frame.tools)
    if (!tool.is_silent)
      tips.push_back({.tool = tool.tool,
                      .position_m = to_double(tool.world_from_proxy.position),
                      .force_n = length(to_double(tool.force_n)),
                      .verb = tool.verb,
                      .has_claim = tool.has_claim});
  lesson::Moment moment{
      .tick = frame.tick, .tips = tips, .displacements = frame.surface, .layout = &layout};
  if (frame.figures.blood)
    moment.blood_m3 = static_cast<double>(frame.figures.blood->shed_nl) * 1e-12;
  return moment;
}

void describe(const lesson::Course& course, proto::LessonStage& message) {
  const auto& lesson = course.lesson();
  const auto& stage = course.stage();
  message.set_title(lesson.title);
  message.set_stage(static_cast<std::uint32_t>(course.stage_number()));
  message.set_stages(static_cast<std::uint32_t>(lesson.stages.size()));
  message.set_name(stage.name);
  message.set_text(stage.text);
  if (course.shows_hint()) message.set_hint(stage.hint);
  if (const auto* picture = lesson.find_picture(stage.picture); picture && !course.is_over())
    message.set_picture(picture->bytes);
  message.set_goal(static_cast<proto::LessonGoal>(static_cast<int>(stage.goal) + 1));
  message.set_begin_tick(course.begin());
  message.set_limit_s(static_cast<float>(stage.limit_s));
  message.set_force_limit_n(static_cast<float>(stage.force_limit_n));
  for (const auto& place : stage.line_m) write(place, *message.add_line_m());
  if (stage.goal == lesson::Goal::Follow) message.set_lap_s(static_cast<float>(stage.lap_s));
  message.set_tolerance_m(static_cast<float>(stage.tolerance_m));
  for (std::size_t i = 0; i < course.results().size(); ++i)
    write(lesson.stages[i], course.results()[i], *message.add_result());
  message.set_is_over(course.is_over());
  message.set_points(static_cast<float>(course.points()));
}

void describe(const lesson::Course& course, proto::LessonProgress& message) {
  message.set_progress(static_cast<float>(course.progress()));
  message.set_seconds(static_cast<float>(course.seconds()));
  message.set_is_too_strong(course.is_too_strong());
}

std::string words_of_last_stage(const lesson::Course& course) {
  const auto& result = course.results().back();
  const auto& stage = course.lesson().stages[course.results().size() - 1];
  auto words = fmt::format("{}: {}, {:.0f} of 100 points", stage.name,
                           result.is_reached ? "reached" : "not reached", result.points);
  if (course.is_over())
    words += fmt::format(". The lesson is over with {:.0f} points", course.points());
  return words;
}

}  // namespace trocar::replication
