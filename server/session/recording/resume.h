#pragma once

// Brings a recorded session back to life where its recording ends: the last snapshot is restored,
// and the inputs after it are simulated again up to the last tick that was recorded whole, with the
// hash of each compared. So the session goes on from exactly the state that verification finds.

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/journal/session_topics.h"
#include "common/lesson/course.h"
#include "server/session/participants/roster.h"
#include "server/tissue/step/simulation.h"

namespace trocar::recording {

struct ResumeOptions {
  unsigned workers = 1;
  // After this tick instead of the last: of a frame, and one that was recorded.
  std::optional<Tick> until;
};

struct ResumedSession {
  step::Simulation simulation;
  journal::Continuation continuation;    // what a new journal has to say
  Tick snapshot_tick = 0;                // simulated again from here on
  std::uint64_t state_hash = 0;          // of the last tick, as recorded
  std::optional<lesson::Course> course;  // of a lesson that had begun
  std::string course_lacks;              // a line: why it does not know all that came before
  // Those who were in the session. A hand is among them if the simulation has its tools, and else
  // it never came.
  std::vector<participants::Participant> participants;
  // Slots whose tools are in the simulation, though the recording does not say whose they are.
  std::vector<ParticipantSlot> unnamed_hands;
};

// Errors: the file is of another sim_version, has a gap or damage, holds no tick, or its simulation
// does not give the recorded hashes.
Result<ResumedSession> resume_session(const std::string& path, const ResumeOptions& options);

}  // namespace trocar::recording
