#include "server/python/session_binding.h"

#include <pybind11/stl.h>

#include "common/lesson/wound.h"
#include "server/python/arrays.h"
#include "server/python/errors.h"
#include "server/python/session.h"
#include "server/python/tissue_arrays.h"

namespace trocar::python {
namespace {

namespace py = pybind11;

constexpr unsigned kMostThreads = 64;
constexpr std::uint64_t kMostTicks = 1'000'000'000;

ParticipantSlot read_hand(int hand) {
  if (hand < 0 || hand >= kMaxHands) throw py::value_error("hand: must be 0 to 15");
  return {static_cast<std::uint8_t>(hand)};
}

ToolSlot read_tool(int hand, int tool) {
  const auto owner = read_hand(hand);
  if (tool < 0 || tool >= kToolsPerHand) throw py::value_error("tool: must be 0 or 1");
  return tool_slot(owner, tool);
}

tool::Verb verb_named(const std::string& name) {
  for (int i = 0; i < tool::kVerbCount; ++i)
    if (const auto verb = static_cast<tool::Verb>(i); name == tool::name_of(verb)) return verb;
  throw py::value_error("verb: is \"" + name + "\", must be none, push, grasp or cut");
}

tool::Form form_named(const std::string& name) {
  for (int i = 0; i < tool::kFormCount; ++i)
    if (const auto form = static_cast<tool::Form>(i); name == tool::name_of(form)) return form;
  throw py::value_error("form: there is no \"" + name + "\", take probe, grasper or scalpel");
}

void put(Session& session, int hand, const py::object& position, const std::string& verb, int tool,
         const py::object& shaft, const py::object& orientation) {
  tool::ToolSample sample;
  const auto slot = read_tool(hand, tool);
  sample.verb = verb_named(verb);
  sample.world_from_tool.position = read_vec3(position, "position");
  if (!orientation.is_none()) {
    sample.world_from_tool.orientation = read_quat(orientation, "orientation");
  } else {
    const Vec3f along = shaft.is_none() ? Vec3f{0, 1, 0} : read_vec3(shaft, "shaft");
    if (!(length(along) > 1e-6f)) throw py::value_error("shaft: must not be zero");
    sample.world_from_tool.orientation = rotation_from_z(along / length(along));
  }
  session.put(slot, sample);
}

void take(Session& session, int hand, int tool, const std::string& form, float radius, float length,
          float reach, float half_width, float friction, float grip, float edge) {
  session.take(read_tool(hand, tool), {.radius_m = radius,
                                       .length_m = length,
                                       .reach_m = reach,
                                       .half_width_m = half_width,
                                       .friction = friction,
                                       .grip_n = grip,
                                       .edge_m = edge,
                                       .form = form_named(form)});
}

py::array vector_of(const Vec3f& v) {
  return take_array(std::vector<float>{v.x, v.y, v.z}, 0);
}

py::array pose_of(const Session& session, int hand, int tool) {
  const auto pose = session.pose(read_tool(hand, tool));
  const auto& p = pose.position;
  const auto& q = pose.orientation;
  return take_array(std::vector<float>{p.x, p.y, p.z, q.x, q.y, q.z, q.w}, 0);
}

py::dict incision(const Session& session, const py::sequence& line, double depth,
                  double tolerance) {
  if (line.size() < 2 || line.size() > lesson::kMostLinePoints)
    throw py::value_error("line: must have 2 to 32 points");
  if (!(depth > 0 && depth < 1)) throw py::value_error("depth: must be above 0 and below 1 m");
  if (!(tolerance > 0 && tolerance < 1))
    throw py::value_error("tolerance: must be above 0 and below 1 m");
  std::vector<Vec3d> points;
  for (const auto point : line)
    points.push_back(to_double(read_vec3(py::reinterpret_borrow<py::object>(point), "line")));
  const auto measured =
      lesson::measure_incision(session.simulation().layout(), points, depth, tolerance);
  py::dict out;
  out["covered"] = measured.covered;
  out["error"] = measured.error_m;
  out["stray"] = measured.stray_m2;
  return out;
}

// Makes a function of the tissue one of a session.
template <typename Function>
auto of_tissue(Function function) {
  return [function](const Session& session) { return function(session.simulation()); };
}

std::unique_ptr<Session> make_session(const organ::Organ& organ, unsigned threads,
                                      const std::optional<lesson::Lesson>& lesson) {
  if (threads < 1 || threads > kMostThreads) throw py::value_error("threads: must be 1 to 64");
  return std::make_unique<Session>(organ, threads, lesson);
}

void step(Session& session, std::int64_t ticks, const py::object& callback) {
  if (ticks < 0 || static_cast<std::uint64_t>(ticks) > kMostTicks)
    throw py::value_error("ticks: must be 0 to 1000000000");
  session.step(static_cast<std::uint64_t>(ticks), callback);
}

void bind_tissue(py::class_<Session>& type) {
  type.def_property_readonly("triangles", of_tissue(triangles_of),
                             "Node numbers of each boundary triangle as it is now, outward; uint32 "
                             "(triangles x 3).")
      .def_property_readonly("wounds", of_tissue(wounds_of),
                             "Whether a blade made each of `triangles`; bool (triangles).")
      .def_property_readonly("tets", of_tissue(tets_of),
                             "Node numbers of each tet as it is now; uint32 (tets x 4).")
      .def_property_readonly("rest_positions", of_tissue(rest_of),
                             "Rest positions of all nodes, m, world frame; float64 (nodes x 3).")
      .def("counts", of_tissue(counts_of),
           "Dict of nodes, tets, triangles, wound_triangles, pieces (that cuts have set free), "
           "edits (cuts and tears) and ties (that hold).")
      .def("incision", &incision, py::arg("line"), py::kw_only(), py::arg("depth"),
           py::arg("tolerance"),
           "What is cut along a line of 2 to 32 points at rest, m, to a depth towards the organ's "
           "centre, m, as lessons measure it: dict of covered (0 to 1), error (mean distance of "
           "the wound from the line, m) and stray (wound farther away than the tolerance, m^2).");
}

void bind_course(py::class_<Session>& type) {
  type.def(
          "course", [](Session& session) { return session.course().told(); },
          "How far the lesson is: dict of stage, stages, is_over, progress (of the goal, 0 to 1), "
          "seconds, is_too_strong, points (0 to 100), target (m, or None) and results, a dict of "
          "is_reached, points and measures for each stage that is over. Raises Error without one.")
      .def(
          "answer",
          [](Session& session, int hand, int tool) {
            const auto slot = read_tool(hand, tool);
            return session.course().answer(slot, session.simulation().layout());
          },
          py::arg("hand") = 0, py::kw_only(), py::arg("tool") = 0,
          "Says \"it is here\", with the tip of a tool as the newest frame has it; returns right, "
          "wrong, not asked or no tissue.")
      .def(
          "next_stage", [](Session& session) { session.course().skip(); },
          "Goes on to the next stage; the goal of this one counts as not reached.");
}

}  // namespace

void bind_session(py::module_& module) {
  const tool::ToolShape usual;
  py::class_<Session> type(
      module, "Session",
      "An organ and hands, without network: a tick is 1 ms of simulated time.\n\n"
      "Results do not depend on `threads`, 1 to 64. While one thread is in step() others may not "
      "use the session: that raises Error. With a `lesson`, whose organ() it is, the session takes "
      "its course, see course().");
  bind_tissue(type);
  bind_course(type);
  type.def(py::init(&make_session), py::arg("organ"), py::kw_only(), py::arg("threads") = 1,
           py::arg("lesson") = py::none())
      .def("step", &step, py::arg("ticks") = 1, py::kw_only(), py::arg("callback") = py::none(),
           "Simulates `ticks` ticks; other threads of Python run meanwhile. `callback(tick)` is "
           "called after each; what it raises, and Ctrl-C, end it between two ticks.")
      .def("put", &put, py::arg("hand"), py::arg("position"), py::arg("verb") = "push",
           py::kw_only(), py::arg("tool") = 0, py::arg("shaft") = py::none(),
           py::arg("orientation") = py::none(),
           "Puts the tip of a hand's tool at `position`, m, world frame, from the next tick on; it "
           "walks there in 10 ticks and stays until it is put elsewhere.\n\n"
           "`hand` 0 to 15 joins by it, `tool` is 0 or 1, `verb` none, push, grasp or cut. `shaft` "
           "is the direction from the tip along the shaft, up without it; `orientation` a "
           "quaternion x, y, z, w in its place.")
      .def("take", &take, py::arg("hand"), py::kw_only(), py::arg("tool") = 0,
           py::arg("form") = "plain", py::arg_v("radius", usual.radius_m, "0.005"),
           py::arg_v("length", usual.length_m, "0.3"), py::arg_v("reach", usual.reach_m, "0.01"),
           py::arg_v("half_width", usual.half_width_m, "0"),
           py::arg_v("friction", usual.friction, "0.2"), py::arg_v("grip", usual.grip_n, "8"),
           py::arg_v("edge", usual.edge_m, "0.02"),
           "Gives a hand another instrument, from the next tick on; lengths in m, grip in N.")
      .def(
          "leave", [](Session& session, int hand) { session.leave(read_hand(hand)); },
          py::arg("hand"), "The hand leaves in the next tick; what it held is set free.")
      .def(
          "force",
          [](const Session& session, int hand, int tool) {
            return vector_of(session.force(read_tool(hand, tool)));
          },
          py::arg("hand") = 0, py::kw_only(), py::arg("tool") = 0,
          "Force of the tissue on a tool after the last tick, N, world frame; float32 (3).")
      .def(
          "tip",
          [](const Session& session, int hand, int tool) {
            return vector_of(session.tip(read_tool(hand, tool)));
          },
          py::arg("hand") = 0, py::kw_only(), py::arg("tool") = 0,
          "Where a tool's tip is, m, world frame; float32 (3). It is on its way to what was put.")
      .def("pose", &pose_of, py::arg("hand") = 0, py::kw_only(), py::arg("tool") = 0,
           "Where a tool is: x, y, z of its tip, m, and its quaternion x, y, z, w, world frame; "
           "float32 (7). Its shaft is along z of its own frame.")
      .def(
          "is_at_work",
          [](const Session& session, int hand, int tool) {
            return session.is_at_work(read_tool(hand, tool));
          },
          py::arg("hand") = 0, py::kw_only(), py::arg("tool") = 0,
          "Whether its push, grasp or cut is in effect.")
      .def("state_hash", &Session::state_hash, "XXH3-64 of the state as it is.")
      .def(
          "save",
          [](const Session& session) {
            const Bytes state = session.save();
            return py::bytes(reinterpret_cast<const char*>(state.data()), state.size());
          },
          "The whole state, to restore() it in a session of an equal organ.")
      .def(
          "restore",
          [](Session& session, const py::bytes& state) {
            session.restore(bytes_of(static_cast<std::string_view>(state)));
          },
          py::arg("state"),
          "Goes on from a state that save() gave; a lesson begins anew. Raises Error, and keeps "
          "its "
          "own state, where the bytes are not one of this organ.")
      .def_property_readonly("tick", &Session::tick, "Ticks done.")
      .def_property_readonly("tick_hash", &Session::tick_hash,
                             "State hash of the last tick, as recordings have it.")
      .def_property_readonly(
          "positions", &Session::positions,
          "Node positions, m, world frame; float32 (nodes x 3), a read-only view "
          "that shows the newest state after each step(). A cut makes nodes: "
          "then ask for it again, the old one stays as it was.")
      .def_property_readonly("velocities", &Session::velocities,
                             "Node velocities, m/s; float32 (nodes x 3), as positions.");
}

}  // namespace trocar::python
