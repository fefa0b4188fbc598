#pragma once

// These render a force at a hand in the closed loop: the model, changed as a mutant of it, and
// the simple schemes that it is compared with, which no product has.

#include <functional>
#include <memory>
#include <vector>

#include "client/haptics/touch_model.h"

namespace trocar::haptics::testing {

class Client {
 public:
  virtual ~Client() = default;
  virtual void take(const wire::HapticPatch& patch) = 0;
  virtual TouchOutput step(const TouchInput& input) = 0;
};

// Changes each patch before the model sees it; `now_us`: the time of its arrival.
using ChangePatch = std::function<void(wire::HapticPatch&, std::uint64_t now_us)>;
std::unique_ptr<Client> make_model(const tool::ToolShape& shape,
                                   const std::vector<wire::HapticLaw>& laws,
                                   const TouchSettings& settings = {},
                                   const ChangePatch& change = nullptr);

// The server's last force.
std::unique_ptr<Client> make_hold();
// The server's last force and its stiffness times the way since.
std::unique_ptr<Client> make_linear(double stiffness_factor);
// A spring of 1 N/mm between the tool and the dented surface as the server had it.
std::unique_ptr<Client> make_penalty();
// The same spring is softer the faster the tool goes in and the older the surface is, so that the
// tissue's yielding since is not felt as stiffness (after Schuwerk et al. 2015, ACM TAP 13:1).
std::unique_ptr<Client> make_scaled_penalty();

// Puts any of them behind the safety chain, on a device of 3.3 N.
std::unique_ptr<Client> make_safe(std::unique_ptr<Client> client);

}  // namespace trocar::haptics::testing
