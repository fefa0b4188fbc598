#include "server/python/session_binding.h"

#include <pybind11/stl.h>

#include "server/python/arrays.h"
#include "server/python/errors.h"
#include "server/python/session.h"

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

std::unique_ptr<Session> make_session(const organ::Organ& organ, unsigned threads) {
  if (threads < 1 || threads > kMostThreads) throw py::value_error("threads: must be 1 to 64");
  return std::make_unique<Session>(organ, threads);
}

void step(Session& session, std::int64_t ticks, const py::object& callback) {
  if (ticks < 0 || static_cast<std::uint64_t>(ticks) > kMostTicks)
    throw py::value_error("ticks: must be 0 to 1000000000");
  session.step(static_cast<std::uint64_t>(ticks), callback);
}

}  // namespace

void bind_session(py::module_& module) {
  const tool::ToolShape usual;
  py::class_<Session>(module, "Session",
                      "An organ and hands, without network: a tick is 1 ms of simulated time.\n\n"
                      "Results do not depend on `threads`, 1 to 64. While one thread is in step() "
                      "others may not use the session: that raises Error.")
      .def(py::init(&make_session), py::arg("organ"), py::kw_only(), py::arg("threads") = 1)
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
          "Goes on from a state that save() gave. Raises Error, and keeps its own state, where the "
          "bytes are not one of this organ.")
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
