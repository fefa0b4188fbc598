#pragma once

// The stage of threads: tools take, drop, push and cut thread, and all threads move by a tick. It
// meets tools where the tissue lets them be.

#include <vector>

#include "server/tissue/step/published_frame.h"
#include "server/tissue/step/tick.h"
#include "server/tissue/thread/thread_step.h"

namespace trocar::step {

// The work of the stage. It follows from the rules and the state.
struct ThreadWork {
  explicit ThreadWork(const thread::Rules& rules) : step(rules) { tools.reserve(kMaxTools); }

  thread::ThreadStep step;
  std::vector<thread::ToolNow> tools;
  thread::ThreadReport report;  // of the last tick
};

// Writes state.threads.
void move_threads(State& state, ThreadWork& work);

// Hands feel thread, too.
void add_pulls(const ThreadWork& work, PublishedFrame& frame);

}  // namespace trocar::step
