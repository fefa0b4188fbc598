#include "server/python/lesson_binding.h"

#include <pybind11/stl.h>

#include "common/lesson/lesson.h"
#include "common/lesson/lesson_texts.h"
#include "server/organs/catalogue/hidden_structures.h"
#include "server/organs/catalogue/load_organ.h"
#include "server/python/errors.h"

namespace trocar::python {
namespace {

namespace py = pybind11;
using lesson::Lesson;

std::vector<std::string> lessons() {
  std::vector<std::string> names;
  for (const auto& text : lesson::lesson_texts()) names.push_back(text.name);
  return names;
}

organ::Organ organ_of(const Lesson& lesson) {
  return value_of([&]() -> Result<organ::Organ> {
    const py::gil_scoped_release others_run;
    auto organ = catalogue::load_organ(lesson.organ);
    if (!organ) return organ;
    if (const auto hidden = catalogue::add_structures(lesson, *organ); !hidden)
      return hidden.error();
    return organ;
  }());
}

py::list stages_of(const Lesson& lesson) {
  py::list stages;
  for (const auto& stage : lesson.stages) {
    py::list line;
    for (const auto& point : stage.line_m) line.append(py::make_tuple(point.x, point.y, point.z));
    py::dict one;
    one["name"] = stage.name;
    one["text"] = stage.text;
    one["goal"] = lesson::name_of(stage.goal);
    one["line"] = line;
    one["limit_s"] = stage.limit_s;
    one["force_limit_n"] = stage.force_limit_n;
    one["hands"] = stage.hands;
    stages.append(one);
  }
  return stages;
}

}  // namespace

void bind_lesson(py::module_& module) {
  py::class_<Lesson>(module, "Lesson",
                     "A lesson: an organ with structures in it, and stages with a goal each.\n\n"
                     "Lesson(\"find-the-lump\") is one that the programs bring, see lessons(); "
                     "Lesson(\"file.toml\") a file. Raises Error with file, line and key.")
      .def(py::init([](const std::string& spec) { return value_of(lesson::find_lesson(spec)); }),
           py::arg("spec"))
      .def("organ", &organ_of,
           "Its organ with the structures in it, for Session(organ, lesson=lesson).")
      .def_readonly("title", &Lesson::title, "What people read.")
      .def_readonly("text", &Lesson::text, "What people read.")
      .def_readonly("organ_name", &Lesson::organ, "A built-in organ's name, or a file's path.")
      .def_readonly("bleeds", &Lesson::bleeds, "Whether what is cut bleeds.")
      .def_property_readonly(
          "stages", &stages_of,
          "Dicts of name, text, goal (find, follow, lift, hold, incise, remove or carry), line "
          "(points, m), limit_s, force_limit_n (0: none) and hands.");
  module.def("lessons", &lessons, "Names of the lessons that the programs bring.");
}

}  // namespace trocar::python
