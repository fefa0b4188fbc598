#pragma once

// Who comes passes the gate (server/session/access), if there is one, and the door, and then needs
// a place that is free. Whoever gets it is in the roster and, with tools, in the inbox.

#include "server/session/access/door.h"
#include "server/session/participants/absences.h"
#include "server/session/replication/audience.h"

namespace trocar::replication {

class Admission {
 public:
  Admission(SessionContext& session, access::Door& door, participants::Absences& absences)
      : session_(session), door_(door), absences_(absences) {}

  // Fills the participant of a newcomer, whose applicant is known; an ending: nothing has changed.
  std::optional<Ending> admit(Speaker& who, HelloRequest& request);

 private:
  // Returns why he may not come, or nothing.
  std::optional<Ending> check(Speaker& who, const HelloRequest& request);
  std::optional<Ending> find_place(Speaker& who, HelloRequest& request);
  bool has_too_many_alike(const Speaker& who) const;

  SessionContext& session_;
  access::Door& door_;
  participants::Absences& absences_;
};

}  // namespace trocar::replication
