#pragma once

// The bus as publisher and taps see it: subjects to listen to and to send to, on one thread, and
// never a wait.

#include <cstdint>
#include <functional>
#include <string>

#include "common/base/bytes.h"
#include "common/base/result.h"

namespace trocar::bus {

class Channel {
 public:
  // `answer_to`: a subject; empty: nobody waits.
  using Take = std::function<void(BytesView bytes, const std::string& answer_to)>;

  virtual ~Channel() = default;

  // `take` is kept until the end. What comes faster than it is taken is left out.
  virtual Status listen(const std::string& subject, Take take) = 0;
  // Queues a message; one that does not fit is left out, and so is each while there is no bus.
  virtual void send(const std::string& subject, Bytes bytes, const std::string& answer_to = "") = 0;
  // Returns the bytes of what was sent and waits for the bus, with what each message costs beside.
  virtual std::size_t waiting_bytes() const = 0;
  // Returns how large one message may be, in bytes; 0: there is no bus now.
  virtual std::size_t most_bytes() const = 0;
};

}  // namespace trocar::bus
