#pragma once

// Instructors give orders about people, their tools and the session; all may say a line.

#include "server/session/access/door.h"
#include "server/session/replication/drawing.h"
#include "server/session/replication/hands.h"
#include "server/session/replication/pace.h"

namespace trocar::proto {
class TeachEvent;
class TeachRequest;
}  // namespace trocar::proto

namespace trocar::replication {

class Teaching {
 public:
  Teaching(SessionContext& session, access::Door& door, Hands& hands, Pace& pace, Drawing& drawing)
      : session_(session), door_(door), hands_(hands), pace_(pace), drawing_(drawing) {}

  // Carries out an order of an instructor, or says a line; everybody is told.
  std::optional<Ending> order(Speaker& who, const proto::TeachRequest& request);
  // After somebody has left: without any instructor nobody could release tools, or let time go on.
  void release_unless_led();

 private:
  std::string carry_out(const TeachOrder& order, const Speaker& who, const std::string& words);
  // Returns the receiver's tool for which the instrument is changed; an error, in words for who
  // asked: there is none, or nothing to give.
  Result<ToolSlot> find_receiving_tool(const TeachOrder& order) const;
  void describe(const TeachOrder& order, ParticipantSlot by, bool is_done, const std::string& text,
                proto::TeachEvent& message) const;

  SessionContext& session_;
  access::Door& door_;
  Hands& hands_;
  Pace& pace_;
  Drawing& drawing_;
};

}  // namespace trocar::replication
