#pragma once

// A simulation that Python drives. While it ticks without Python's lock no other thread may use it:
// each call says so then with trocar.Error, but for those from the callback between two ticks.
//
// Tools that were put stay where they are: their last sample is given again every 8 ticks, as a
// hand that holds still does. Whatever follows depends on the state and on what is put only, so a
// restored session goes on to the bit.

#include <pybind11/numpy.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/tool/tool.h"
#include "server/organs/organ/organ.h"
#include "server/python/session_course.h"
#include "server/tissue/step/simulation.h"

namespace trocar::python {

class Session {
 public:
  // lesson: none, or that whose course the session takes.
  Session(const organ::Organ& organ, unsigned threads, std::optional<lesson::Lesson> lesson);

  // Simulates n ticks, 1 ms each; callback(tick) after each.
  void step(std::uint64_t ticks, const pybind11::object& callback);
  void put(ToolSlot tool, const tool::ToolSample& sample);
  // Another instrument; the hand joins if it is not there.
  void take(ToolSlot tool, const tool::ToolShape& shape);
  void leave(ParticipantSlot hand);

  Tick tick() const;
  Vec3f force(ToolSlot tool) const;      // of the tissue on the tool, N, world frame
  Vec3f tip(ToolSlot tool) const;        // m, world frame
  Pose pose(ToolSlot tool) const;        // world from tool
  bool is_at_work(ToolSlot tool) const;  // its push, grasp or cut is in effect
  std::uint64_t state_hash() const;
  std::uint64_t tick_hash() const;  // after the last tick, as recordings have it
  Bytes save() const;
  // A lesson begins anew.
  void restore(BytesView state);

  // Error: there is none.
  SessionCourse& course();
  // Shows what is simulated, between two ticks.
  const step::Simulation& simulation() const;

  // Float32 (nodes x 3); shown again after each step, and another array once a cut made nodes.
  pybind11::array positions() const;
  pybind11::array velocities() const;

 private:
  using Floats = std::vector<float>;

  void check_free() const;
  void tick_once();
  void gather_inputs();
  void refresh();  // the arrays, from the state
  bool is_present(ToolSlot tool) const;
  void join(ParticipantSlot hand, int number, const tool::ToolShape& shape);

  step::Simulation simulation_;
  const step::TickDecisions decisions_;
  hands::TickInputs next_;    // of the next tick, as put by Python
  hands::TickInputs inputs_;  // scratch
  std::optional<SessionCourse> course_;
  std::uint64_t tick_hash_ = 0;
  std::shared_ptr<Floats> positions_, velocities_;
  bool is_ticking_ = false, is_stepping_ = false;
};

}  // namespace trocar::python
