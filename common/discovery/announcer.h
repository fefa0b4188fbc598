#pragma once

// Announces one session for as long as this lives, through the machine's Avahi daemon. A machine
// without one is no fault: the log says so once. Avahi has a thread of its own here; every call may
// come from any thread.

#include <cstdint>
#include <memory>

#include "common/discovery/notice.h"

namespace trocar::discovery {

class Announcer {
 public:
  Announcer(const SessionNotice& notice, std::uint16_t port);
  ~Announcer();
  Announcer(const Announcer&) = delete;
  Announcer& operator=(const Announcer&) = delete;

  void set_people(int people);

 private:
  struct Service;
  std::unique_ptr<Service> service_;
};

}  // namespace trocar::discovery
