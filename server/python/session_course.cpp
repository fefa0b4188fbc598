#include "server/python/session_course.h"

#include <cmath>

#include "common/wire/claim_outcome.h"
#include "server/session/replication/lesson_messages.h"

namespace trocar::python {
namespace {

namespace py = pybind11;

py::dict told_result(const lesson::StageResult& result) {
  py::dict values;
  for (int i = 0; i < lesson::kMeasures; ++i) {
    const auto measure = static_cast<lesson::Measure>(i);
    const double value = result.value(measure);
    if (!std::isnan(value)) values[lesson::key_of(measure)] = lesson::in_unit(measure, value);
  }
  py::dict out;
  out["is_reached"] = result.is_reached;
  out["points"] = result.points;
  out["measures"] = values;
  return out;
}

}  // namespace

void SessionCourse::observe(std::shared_ptr<const step::PublishedFrame> frame,
                            const wire::SurfaceLayout& layout) {
  if (!frame_ && frame->tools.empty()) return;
  frame_ = std::move(frame);
  for (const auto& event : frame_->claim_events)
    if (wire::is_refusal(event.outcome) || event.outcome == wire::ClaimOutcome::Slipped)
      course_.note_refusal();
  course_.observe(replication::moment_of(*frame_, layout, tips_));
}

const char* SessionCourse::answer(ToolSlot tool, const wire::SurfaceLayout& layout) {
  if (!frame_) return "no tissue";
  switch (course_.answer(tool, replication::moment_of(*frame_, layout, tips_))) {
    case lesson::Answer::NotAsked:
      return "not asked";
    case lesson::Answer::NoTissue:
      return "no tissue";
    case lesson::Answer::Wrong:
      return "wrong";
    case lesson::Answer::Right:
      return "right";
  }
  return "";
}

py::dict SessionCourse::told() const {
  py::list results;
  for (const auto& result : course_.results()) results.append(told_result(result));
  py::dict out;
  out["stage"] = course_.stage_number();
  out["stages"] = course_.lesson().stages.size();
  out["is_over"] = course_.is_over();
  out["progress"] = course_.progress();
  out["seconds"] = course_.seconds();
  out["is_too_strong"] = course_.is_too_strong();
  out["points"] = course_.points();
  const auto target = course_.target_m();
  out["target"] = target ? py::object(py::make_tuple(target->x, target->y, target->z)) : py::none();
  out["results"] = results;
  return out;
}

}  // namespace trocar::python
