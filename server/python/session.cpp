#include "server/python/session.h"

#include <algorithm>

#include "server/python/arrays.h"
#include "server/python/errors.h"
#include "server/session/replication/lesson_messages.h"
#include "server/tissue/contact/proxies.h"
#include "server/tissue/hands/sampling.h"

namespace trocar::python {
namespace {

namespace py = pybind11;

class Flag {
 public:
  explicit Flag(bool& flag) : flag_(flag) { flag_ = true; }
  Flag(const Flag&) = delete;
  Flag& operator=(const Flag&) = delete;
  ~Flag() { flag_ = false; }

 private:
  bool& flag_;
};

// Puts x, y, z of each node into an array that is still the node count's, or into a new one.
template <typename Value>
void fill(std::shared_ptr<std::vector<float>>& out, std::size_t nodes, const Value& value) {
  if (!out || out->size() != 3 * nodes) out = std::make_shared<std::vector<float>>(3 * nodes);
  float* at = out->data();
  for (std::size_t i = 0; i < nodes; ++i) {
    const Vec3f v = value(i);
    *at++ = v.x, *at++ = v.y, *at++ = v.z;
  }
}

py::array shared_view(const std::shared_ptr<std::vector<float>>& numbers) {
  using Shared = std::shared_ptr<std::vector<float>>;
  auto kept = std::make_unique<Shared>(numbers);
  py::capsule owner(kept.get(), [](void* shared) { delete static_cast<Shared*>(shared); });
  kept.release();
  return view_of(numbers->data(), numbers->size() / 3, 3, owner);
}

}  // namespace

Session::Session(const organ::Organ& organ, unsigned threads, std::optional<lesson::Lesson> lesson)
    : simulation_(organ, threads,
                  {.bleeding = replication::bleeding_rules(lesson ? &*lesson : nullptr, false)}),
      decisions_(simulation_.with_sweeps_for_organ({})) {
  if (lesson) course_.emplace(*std::move(lesson));
  tick_hash_ = simulation_.state_hash();
  refresh();
}

void Session::check_free() const {
  if (is_ticking_)
    raise({ErrorCode::Refused, "session: ticks in another thread, wait until its step() returns"});
}

bool Session::is_present(ToolSlot tool) const {
  return simulation_.state().tools[tool].is_present;
}

void Session::join(ParticipantSlot hand, int number, const tool::ToolShape& shape) {
  const auto is_hand = [hand](const hands::HandJoin& known) { return known.slot == hand; };
  auto known = std::ranges::find_if(next_.joins, is_hand);
  if (known == next_.joins.end()) {
    next_.joins.push_back({.slot = hand, .tool_count = kToolsPerHand});
    known = next_.joins.end() - 1;
  }
  known->shapes[static_cast<std::size_t>(number)] = shape;
}

void Session::put(ToolSlot tool, const tool::ToolSample& sample) {
  check_free();
  const bool joins = std::ranges::any_of(
      next_.joins, [&](const hands::HandJoin& known) { return known.slot == tool.owner(); });
  if (!is_present(tool) && !joins) join(tool.owner(), tool.number(), {});
  std::erase_if(next_.samples, [tool](const hands::ToolInput& s) { return s.tool == tool; });
  next_.samples.push_back({.tool = tool, .sample = sample});
}

void Session::take(ToolSlot tool, const tool::ToolShape& shape) {
  check_free();
  if (!tool::is_valid(shape))
    raise({ErrorCode::Usage,
           "instrument: a size is out of range: radius 0.0005 to 0.05 m, length 0.01 to 1 m, reach "
           "0.001 to 0.05 m, half_width 0 to 0.05 m, friction 0 to 2, grip 0.1 to 100 N or 0, edge "
           "0.001 to 0.2 m or 0"});
  if (!is_present(tool)) return join(tool.owner(), tool.number(), shape);
  std::erase_if(next_.changes, [tool](const hands::ToolChange& c) { return c.tool == tool; });
  next_.changes.push_back({tool, shape});
}

void Session::leave(ParticipantSlot hand) {
  check_free();
  std::erase_if(next_.joins, [hand](const hands::HandJoin& join) { return join.slot == hand; });
  std::erase_if(next_.changes,
                [hand](const hands::ToolChange& c) { return c.tool.owner() == hand; });
  std::erase_if(next_.samples,
                [hand](const hands::ToolInput& s) { return s.tool.owner() == hand; });
  if (is_present(tool_slot(hand, 0)) && std::ranges::find(next_.leaves, hand) == next_.leaves.end())
    next_.leaves.push_back(hand);
}

void Session::gather_inputs() {
  inputs_ = next_;
  next_.clear();
  if (!hands::takes_samples(simulation_.current_tick() + 1)) return;
  for (int slot = 0; slot < kMaxTools; ++slot) {
    const ToolSlot tool{static_cast<std::uint8_t>(slot)};
    const auto& known = simulation_.state().tools[tool];
    const bool leaves = std::ranges::find(inputs_.leaves, tool.owner()) != inputs_.leaves.end();
    const bool is_put = std::ranges::any_of(
        inputs_.samples, [tool](const hands::ToolInput& s) { return s.tool == tool; });
    if (known.is_present && known.has_sample && !is_put && !leaves)
      inputs_.samples.push_back({.tool = tool, .sample = {known.target, known.verb}});
  }
}

void Session::tick_once() {
  const Flag ticking(is_ticking_);
  const py::gil_scoped_release others_run;
  gather_inputs();
  tick_hash_ = simulation_.tick(inputs_, decisions_).state_hash;
  const auto frame = simulation_.pop_frame();
  if (frame && course_) course_->observe(frame, simulation_.layout());
}

void Session::step(std::uint64_t ticks, const py::object& callback) {
  check_free();
  if (is_stepping_)
    raise({ErrorCode::Refused, "session: is in step() already, wait until that returns"});
  if (!callback.is_none() && PyCallable_Check(callback.ptr()) == 0)
    throw py::type_error("callback: cannot be called");
  const Flag stepping(is_stepping_);
  try {
    for (std::uint64_t i = 0; i < ticks; ++i) {
      tick_once();
      if (PyErr_CheckSignals() != 0) throw py::error_already_set();
      if (callback.is_none()) continue;
      refresh();
      callback(simulation_.current_tick());
    }
  } catch (...) {
    refresh();
    throw;
  }
  refresh();
}

void Session::refresh() {
  const auto& world = simulation_.state().world;
  fill(positions_, world.node_count(), [&](std::size_t i) { return world.position(NodeIndex(i)); });
  fill(velocities_, world.node_count(), [&](std::size_t i) { return world.velocities[i]; });
}

Tick Session::tick() const {
  check_free();
  return simulation_.current_tick();
}

Vec3f Session::force(ToolSlot tool) const {
  check_free();
  const auto& state = simulation_.state();
  Vec3f force = state.cuts.felt(tool).force_n;
  const auto& contacts = simulation_.context().contact.found;
  for (const auto& contact : contacts.tools)
    if (contact.tool == tool) force += contact::reaction_on(contacts, contact, state.world).force_n;
  return force;
}

Vec3f Session::tip(ToolSlot tool) const {
  check_free();
  return simulation_.state().tools[tool].pose.position;
}

Pose Session::pose(ToolSlot tool) const {
  check_free();
  return simulation_.state().tools[tool].pose;
}

bool Session::is_at_work(ToolSlot tool) const {
  check_free();
  return simulation_.state().claims.is_in_effect(tool);
}

SessionCourse& Session::course() {
  check_free();
  if (!course_) raise({ErrorCode::Usage, "session: has no lesson, make it with lesson="});
  return *course_;
}

const step::Simulation& Session::simulation() const {
  check_free();
  return simulation_;
}

std::uint64_t Session::state_hash() const {
  check_free();
  return simulation_.state_hash();
}

std::uint64_t Session::tick_hash() const {
  check_free();
  return tick_hash_;
}

Bytes Session::save() const {
  check_free();
  Bytes state;
  simulation_.write_snapshot(state);
  return state;
}

void Session::restore(BytesView state) {
  check_free();
  if (is_stepping_)
    raise({ErrorCode::Refused, "session: is in step(), restore it when that has returned"});
  check(simulation_.restore_snapshot(state));
  next_.clear();
  if (course_) course_.emplace(lesson::Lesson(course_->lesson()));
  tick_hash_ = simulation_.state_hash();
  refresh();
}

py::array Session::positions() const {
  check_free();
  return shared_view(positions_);
}

py::array Session::velocities() const {
  check_free();
  return shared_view(velocities_);
}

}  // namespace trocar::python
