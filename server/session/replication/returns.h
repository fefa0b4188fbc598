#pragma once

// Places of those who have lost the connection are kept for a while. Whoever comes back with the
// token of the Welcome and the name gets the place again, also while the old connection still
// hangs. (Who may come back, and for how long, is in participants/absences.h.)

#include <map>
#include <memory>
#include <vector>

#include "server/session/participants/absences.h"
#include "server/session/replication/audience.h"

namespace trocar::replication {

class Returns {
 public:
  Returns(SessionContext& session, ReplicatorCounters& counters)
      : session_(session), counters_(counters), absences_(session.options.return_seconds) {}

  // Keeps the place of somebody who has one; null: there is no way back to it.
  bool keep(std::unique_ptr<Speaker>& who);
  // Before the first connection: somebody who was in the session that this one goes on with.
  bool restore(participants::Participant who, const participants::ReturnToken& token,
               std::uint32_t code);
  // Returns the place to which this Hello comes back; null: there is none.
  const participants::Participant* find_own_place(const HelloRequest& request) const;
  // `who` has the place of `before` from now on, who is away or whose connection hangs.
  void come_back(Speaker& who, const Speaker& before);

  Speaker* find(ParticipantSlot slot) const;
  std::unique_ptr<Speaker> take(ParticipantSlot slot);
  // Those who have been away for too long by then, or whose code was revoked.
  std::vector<std::unique_ptr<Speaker>> take_expired(std::uint64_t now_ns);
  std::vector<std::unique_ptr<Speaker>> take_revoked();

  participants::Absences& absences() { return absences_; }
  const participants::Absences& absences() const { return absences_; }

 private:
  SessionContext& session_;
  ReplicatorCounters& counters_;
  participants::Absences absences_;
  std::map<ParticipantSlot, std::unique_ptr<Speaker>> away_;
};

}  // namespace trocar::replication
