#pragma once

// All that a program has between the server's answers and a device, as a client of the closed loop.

#include <memory>
#include <vector>

#include "client/haptics/safety.h"
#include "tests/haptics/clients.h"

namespace trocar::haptics::testing {

// The greatest changes within a millisecond, N.
struct FeltSteps {
  double model_n = 0;  // of what the model asks for
  double hand_n = 0;   // of what is written to the device
  double largest_n = 0;
};

// On a device of 8 N. `steps` outlives it.
std::unique_ptr<Client> make_hand(const tool::ToolShape& shape,
                                  const std::vector<wire::HapticLaw>& laws, FeltSteps& steps,
                                  const SafetySettings& safety = {});

}  // namespace trocar::haptics::testing
