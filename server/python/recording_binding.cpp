#include "server/python/recording_binding.h"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <filesystem>
#include <limits>
#include <optional>

#include "common/base/printable.h"
#include "common/tool/tool.h"
#include "common/wire/claim_outcome.h"
#include "server/python/arrays.h"
#include "server/python/errors.h"
#include "server/session/recording/recorded_session.h"
#include "server/session/recording/surface_reader.h"

namespace trocar::python {
namespace {

namespace py = pybind11;
using journal::SessionJournal;

constexpr Tick kEnd = std::numeric_limits<Tick>::max();

struct FrameArrays {
  Tick tick = 0;
  py::array positions, triangles;
};

// Its file is closed by close(), or with the last frame iterator.
class Recording {
 public:
  explicit Recording(const std::filesystem::path& path)
      : path_(path.string()), journal_(value_of(SessionJournal::open(path_))) {
    // One that was cut before the organ's end would be read as an empty one.
    if (const auto organ = journal_->organ(); !organ) raise(organ.error());
  }

  SessionJournal& journal() const { return *open(); }
  const journal::SessionInfo& info() const { return open()->info(); }
  const std::string& path() const { return path_; }
  std::shared_ptr<SessionJournal> open() const {
    if (!journal_) throw py::value_error(path_ + ": the recording is closed");
    return journal_;
  }
  void close() { journal_.reset(); }

 private:
  std::string path_;
  std::shared_ptr<SessionJournal> journal_;
};

class FrameIterator {
 public:
  FrameIterator(std::shared_ptr<SessionJournal> journal, Tick from, Tick to)
      : reader_(std::move(journal), from, to) {}

  FrameArrays next() {
    auto frame = value_of(reader_.next());
    if (!frame) throw py::stop_iteration();
    return {frame->tick, take_array(std::move(frame->positions_m), 3),
            take_array(std::move(frame->triangles), 3)};
  }

 private:
  recording::SurfaceReader reader_;
};

Tick read_tick(std::int64_t tick, const char* name) {
  if (tick < 0) throw py::value_error(std::string(name) + ": must be a tick, 0 or more");
  return static_cast<Tick>(tick);
}

FrameIterator frames(const Recording& recording, std::int64_t start,
                     const std::optional<std::int64_t>& stop) {
  const Tick from = read_tick(start, "start");
  const Tick end = stop ? read_tick(*stop, "stop") : kEnd;
  if (end < from) throw py::value_error("stop: must not be before start");
  // An empty range begins after its end.
  if (end == 0) return {recording.open(), 1, 0};
  return {recording.open(), from, end - 1};
}

FrameArrays seek(const Recording& recording, std::int64_t tick) {
  const Tick at = read_tick(tick, "tick");
  const auto key = value_of(recording.journal().surface_key_before(at));
  recording::SurfaceReader reader(recording.open(), key ? Tick{key->tick()} : 0, at);
  std::optional<recording::SurfaceAt> last;
  while (auto frame = value_of(reader.next())) last = std::move(frame);
  if (!last)
    raise({ErrorCode::BadFile,
           recording.path() + ": has no frame at or before tick " + std::to_string(at)});
  return {last->tick, take_array(std::move(last->positions_m), 3),
          take_array(std::move(last->triangles), 3)};
}

py::str text_of(const std::string& text) {
  return py::str(printable(text));
}

const char* verb_name(int verb) {
  return tool::name_of(static_cast<tool::Verb>(std::clamp(verb, 0, 255)));
}

std::string outcome_name(int outcome) {
  std::string name = proto::ClaimOutcome_Name(outcome);
  if (name.empty()) return "unknown";
  name.erase(0, std::string_view("CLAIM_").size());
  for (char& c : name) c = c == '_' ? ' ' : static_cast<char>(std::tolower(c));
  return name;
}

py::list participants(const Recording& recording) {
  py::list list;
  for (const auto& person : recording.info().participants) {
    py::dict one;
    one["slot"] = person.slot();
    one["name"] = text_of(person.name());
    list.append(one);
  }
  return list;
}

py::list events(const Recording& recording) {
  struct Event {
    Tick tick = 0;
    py::dict fields;
  };
  std::vector<Event> all;
  auto& journal = recording.journal();
  check(journal.read_claims(0, kEnd, [&all](Tick, const proto::ClaimLog& log) {
    for (const auto& claim : log.event()) {
      auto& fields = all.emplace_back(Event{claim.tick(), {}}).fields;
      fields["tick"] = claim.tick();
      fields["kind"] = "claim";
      fields["tool"] = claim.tool();
      fields["what"] = outcome_name(claim.outcome());
      fields["verb"] = verb_name(claim.verb());
    }
    return true;
  }));
  check(journal.read_participants(0, kEnd, [&all](Tick tick, const proto::Participants& list) {
    auto& fields = all.emplace_back(Event{tick, {}}).fields;
    fields["tick"] = tick;
    fields["kind"] = "participants";
    fields["tool"] = py::none();
    py::list names;
    for (const auto& person : list.participant()) names.append(text_of(person.name()));
    fields["what"] = py::str(", ").attr("join")(names);
    fields["verb"] = py::none();
    return true;
  }));
  std::ranges::stable_sort(all, {}, &Event::tick);
  py::list out;
  for (const auto& event : all) out.append(event.fields);
  return out;
}

// Columns of equal length, as pandas.DataFrame takes them.
py::dict tools(const Recording& recording) {
  std::vector<std::uint64_t> tick;
  std::vector<std::uint32_t> tool, contacts;
  std::vector<float> x, y, z, qx, qy, qz, qw, fx, fy, fz;
  py::list verbs;
  check(
      recording.journal().read_frame_states(0, kEnd, [&](Tick at, const proto::FrameState& state) {
        for (const auto& one : state.tool()) {
          tick.push_back(at);
          tool.push_back(one.tool());
          contacts.push_back(one.contact_nodes());
          x.push_back(one.position_m().x());
          y.push_back(one.position_m().y());
          z.push_back(one.position_m().z());
          qx.push_back(one.orientation().x());
          qy.push_back(one.orientation().y());
          qz.push_back(one.orientation().z());
          qw.push_back(one.orientation().w());
          fx.push_back(one.force_n().x());
          fy.push_back(one.force_n().y());
          fz.push_back(one.force_n().z());
          verbs.append(verb_name(one.verb()));
        }
        return true;
      }));
  py::dict out;
  out["tick"] = take_array(std::move(tick), 0);
  out["tool"] = take_array(std::move(tool), 0);
  out["verb"] = verbs;
  out["x_m"] = take_array(std::move(x), 0);
  out["y_m"] = take_array(std::move(y), 0);
  out["z_m"] = take_array(std::move(z), 0);
  out["qx"] = take_array(std::move(qx), 0);
  out["qy"] = take_array(std::move(qy), 0);
  out["qz"] = take_array(std::move(qz), 0);
  out["qw"] = take_array(std::move(qw), 0);
  out["fx_n"] = take_array(std::move(fx), 0);
  out["fy_n"] = take_array(std::move(fy), 0);
  out["fz_n"] = take_array(std::move(fz), 0);
  out["contact_nodes"] = take_array(std::move(contacts), 0);
  return out;
}

py::array tick_hashes(const Recording& recording) {
  std::vector<std::uint64_t> hashes;
  check(recording.journal().read_tick_records(0, kEnd,
                                              [&hashes](Tick, const proto::TickRecord& record) {
                                                hashes.push_back(record.state_hash());
                                                return true;
                                              }));
  return take_array(std::move(hashes), 0);
}

py::array recorded_ticks(const Recording& recording) {
  std::vector<std::uint64_t> ticks;
  check(recording.journal().read_tick_records(0, kEnd, [&ticks](Tick tick, const auto&) {
    ticks.push_back(tick);
    return true;
  }));
  return take_array(std::move(ticks), 0);
}

}  // namespace

void bind_recording(py::module_& module) {
  py::class_<FrameArrays>(module, "Frame", "The surface of a recording at a tick.")
      .def_readonly("tick", &FrameArrays::tick, "Ticks since the session began.")
      .def_readonly("positions", &FrameArrays::positions,
                    "Vertex positions, m, world frame, on a grid of 32 um; float32 (vertices x 3).")
      .def_readonly("triangles", &FrameArrays::triangles,
                    "Vertex numbers, counterclockwise from outside; uint32 (triangles x 3).");
  py::class_<FrameIterator>(module, "FrameIterator", "Frames of a recording, in order.")
      .def(
          "__iter__", [](py::object self) { return self; }, "Returns itself.")
      .def("__next__", &FrameIterator::next, "The next frame.");
  py::class_<Recording>(module, "Recording",
                        "A recorded session or scenario (.mcap). Nothing is simulated.\n\n"
                        "Use it by `with`, or close() it. Raises Error where it is damaged.")
      .def(py::init<const std::filesystem::path&>(), py::arg("path"))
      .def("frames", &frames, py::arg("start") = 0, py::arg("stop") = py::none(),
           "Iterates over frames with a tick from `start` to before `stop`.")
      .def("seek", &seek, py::arg("tick"), "The frame at or before a tick.")
      .def("events", &events,
           "Claims and changes of the list of participants, by tick: dicts of tick, kind, tool "
           "(slot: participant x 2 + number), what and verb.")
      .def("tools", &tools,
           "A row for each tool of each frame, as columns for pandas.DataFrame: tick, tool (slot), "
           "verb, tip (m), orientation (quaternion), force of the tissue on it (N), nodes in "
           "contact.")
      .def("tick_hashes", &tick_hashes, "State hash after each recorded tick; uint64 (ticks).")
      .def("ticks", &recorded_ticks, "The ticks that tick_hashes() is of; uint64 (ticks).")
      .def(
          "organ",
          [](const Recording& recording) {
            return value_of(recording::recorded_organ(recording.journal(), recording.path()));
          },
          "The organ as it was at first.")
      .def("close", &Recording::close, "Closes the file. Everything else raises ValueError then.")
      .def(
          "__enter__", [](py::object self) { return self; }, "Returns itself.")
      .def(
          "__exit__", [](Recording& recording, const py::args&) { recording.close(); },
          "Closes the file.")
      .def_property_readonly("participants", &participants,
                             "Who was ever in: dicts of slot and name.")
      .def_property_readonly(
          "organ_name", [](const Recording& r) { return text_of(r.info().organ_name); },
          "Name of the organ.")
      .def_property_readonly(
          "last_tick", [](const Recording& r) { return r.info().last_tick; },
          "Tick of the last message.")
      .def_property_readonly(
          "start_utc_ns", [](const Recording& r) { return r.info().start_utc_ns; },
          "Time of tick 0, ns since 1970 (UTC).")
      .def_property_readonly(
          "sim_version", [](const Recording& r) { return r.info().sim_version; },
          "Version of the simulation; another one gives other hashes.")
      .def_property_readonly(
          "is_finished", [](const Recording& r) { return r.info().is_finished; },
          "False: it was cut short, or repaired.")
      .def_property_readonly(
          "summary", [](const Recording& r) { return text_of(r.info().summary); },
          "One line for people.");
}

}  // namespace trocar::python
