#pragma once

// These functions carry what acts on the tissue of a scenario besides its tools between the
// simulation's rules and the journal's message, bit for bit.

#include "common/base/result.h"
#include "server/tissue/step/external_loads.h"

namespace trocar::proto {
class ExternalLoads;
}

namespace trocar::recording {

void to_message(const step::LoadRules& rules, proto::ExternalLoads& message);

// Untrusted bytes: rules that come out are those of a scenario on this organ. Error says which load
// is wrong, and how.
Result<step::LoadRules> from_message(const proto::ExternalLoads& message,
                                     const organ::Organ& organ);

}  // namespace trocar::recording
