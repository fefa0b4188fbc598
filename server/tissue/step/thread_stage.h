#pragma once

// The stage of threads: tools take, drop, push and cut thread, and all threads move by a tick. It
// meets tools where the tissue lets them be.

#include <array>
#include <span>
#include <vector>

#include "common/wire/thread_codec.h"
#include "server/tissue/step/published_frame.h"
#include "server/tissue/step/tick.h"
#include "server/tissue/thread/thread_step.h"

namespace trocar::step {

// The work of the stage. It follows from the rules and the state.
struct ThreadWork {
  explicit ThreadWork(const thread::Rules& rules);

  thread::ThreadStep step;
  std::vector<thread::ToolNow> tools;
  thread::ThreadReport report;                       // of the last tick
  std::array<hands::ThreadGrip, kMaxTools> grips{};  // likewise
  wire::ThreadPicture picture;                       // of the last frame
};

// Writes state.threads.
void move_threads(State& state, ThreadWork& work);

// For the claims, by tool; null work: there is no thread.
std::span<const hands::ThreadGrip> thread_grips(const ThreadWork* work);

// People see all thread, and hands feel it.
void publish_threads(const thread::Threads& threads, ThreadWork& work, PublishedFrame& frame);

}  // namespace trocar::step
