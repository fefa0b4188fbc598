#pragma once

// A server begins with an organ at rest, or with the state in which a recording ends.

#include <memory>
#include <optional>
#include <vector>

#include "common/base/result.h"
#include "common/journal/session_topics.h"
#include "common/lesson/course.h"
#include "common/secure/signing.h"
#include "server/app/server/options.h"
#include "server/organs/organ/organ.h"
#include "server/session/participants/roster.h"
#include "server/tissue/step/simulation.h"

namespace trocar::app {

struct SessionStart {
  step::Simulation simulation;
  std::optional<secure::SigningKey> key;  // signs the recording
  // The rest is of a session that goes on.
  std::optional<journal::Continuation> continues;
  std::shared_ptr<lesson::Course> course;               // null: no lesson had begun
  std::vector<participants::Participant> participants;  // who was in it
  std::vector<ParticipantSlot> unnamed_hands;           // whose tools are there, nobody knows whose
};

// Strain averaged or plain, as the options say.
Status choose_strain(const ServerOptions& options, organ::Organ& organ);

// Reads the key that --sign names; nothing if it names none.
Result<std::optional<secure::SigningKey>> read_signing_key(const ServerOptions& options);

// Reads what the options name, and says what it did where that takes long.
Result<SessionStart> start_session(const ServerOptions& options);

}  // namespace trocar::app
