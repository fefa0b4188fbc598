#pragma once

// The people of a session as its parts see them (hands.h, teaching.h, pace.h, marks.h, drawing.h,
// lesson_course.h). A part gets who speaks and what was said; it answers through the Audience, and
// returns an Ending where the session of who speaks must end.

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "common/wire/framing.h"
#include "server/session/access/gate.h"
#include "server/session/net/connections.h"
#include "server/session/pacing/allowance.h"
#include "server/session/participants/inbox.h"
#include "server/session/participants/roster.h"
#include "server/session/replication/replicator_options.h"
#include "server/tissue/step/published_frame.h"

namespace google::protobuf {
class MessageLite;
}

namespace trocar::replication {

// Somebody who is here: who it is, and how much it may still say.
struct Speaker {
  Speaker(net::ConnectionId its_id, const ReplicatorOptions& options)
      : id(its_id),
        hand_moments(options.max_hand_moments_per_second, options.clock_ns()),
        sayings(1, options.clock_ns()),
        strokes(10, options.clock_ns()),
        changes(5, options.clock_ns()),
        reports(1, options.clock_ns()) {}

  const net::ConnectionId id;   // 0: there has been no connection to this server
  bool is_guest = false;        // many share the connection
  access::Applicant applicant;  // with the name of its Hello
  std::optional<participants::Participant> participant;  // set by Hello
  std::uint64_t pointed_ns = 0;                          // when it pointed last; 0: it does not
  std::uint64_t viewed_ns = 0;                           // when it said last where its view is
  std::array<std::optional<std::uint32_t>, kToolsPerHand> last_sequence;  // of samples
  pacing::Allowance hand_moments, sayings, strokes, changes, reports;     // that it may send
};

class Audience {
 public:
  virtual ~Audience() = default;
  // False: there is no room for it.
  virtual bool send(const Speaker& to, const wire::SharedBytes& bytes) = 0;
  // Tells everybody. The session ends of who has no room for it.
  virtual void broadcast(const wire::SharedBytes& bytes) = 0;
  // Tells everybody, but `but`, who has room for it.
  virtual void offer(const wire::SharedBytes& bytes, const Speaker* but = nullptr) = 0;
  // Whoever has that place, away or not; null: nobody.
  virtual Speaker* find(ParticipantSlot slot) const = 0;
  // Ends the session of whoever has that place, away or not; `words` says why.
  virtual void put_out(ParticipantSlot slot, const std::string& words) = 0;
  // Null: none has been published.
  virtual const step::SharedFrame& newest_frame() const = 0;

  Tick newest_tick() const { return newest_frame() ? newest_frame()->tick : 0; }
};

// All parts of a session share this.
struct SessionContext {
  const ReplicatorOptions& options;
  Audience& audience;
  participants::Roster& roster;
  participants::SimulationInbox& inbox;
  // The roster has changed since on_participants was called; those who are here are told of it.
  bool has_changed = false;
  bool is_told = true;

  std::uint64_t now_ns() const { return options.clock_ns(); }
  // Writes what was said or shown into the recording.
  void record(wire::LessonKind kind, const google::protobuf::MessageLite& message) const;
  // Tells who asked that nothing was done, and why.
  void refuse(const Speaker& who, const std::string& why) const;
};

}  // namespace trocar::replication
