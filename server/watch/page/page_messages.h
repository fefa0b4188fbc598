#pragma once

// These are the messages that a page may say to a session.

#include <array>

#include "common/base/bytes.h"
#include "common/base/ids.h"
#include "common/wire/framing.h"
#include "common/wire/role.h"

namespace trocar::proto {
class Envelope;
}

namespace trocar::page {

// Decodes what a page has sent. False: it is none of the messages of that role.
bool read_page_message(BytesView envelope, wire::Role role, proto::Envelope& message);

// Tells what somebody does from what a page says by itself.
class Deeds {
 public:
  // True: the person has done something. A tool that stays where it is does nothing.
  bool note(const proto::Envelope& message);

 private:
  std::array<std::array<float, 4>, kToolsPerHand> last_{};  // position, m, and verb, of each tool
};

}  // namespace trocar::page
