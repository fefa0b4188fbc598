#pragma once

// The sessions of all clients: who they are, what they may say, and what each was given last.
//
//   Hello -> Welcome, Participants, SurfaceTopology, keyframe -> then per published frame
//            SurfaceChange (where it begins an epoch), SurfaceFrame (delta against the last frame
//            this client was given, whichever epoch that was), FrameState
//
// Each of these is a part of its own: who comes (admission.h), who comes back (returns.h), what
// each is given and how it says that it has it (viewers.h), and what people say and do (hands.h,
// teaching.h, pace.h, marks.h, drawing.h, lesson_course.h). Parts speak to people through Audience,
// which this is. What is left here is who is connected as whom, which message is for which part,
// and the surface as it is now.
//
// Inbound: every message is checked by role and range (validation.h); samples, joins and leaves go
// to the simulation through the SimulationInbox. Anything malformed, oversized, too frequent or not
// this role's to say ends that session with a Goodbye that names the reason; nobody else notices.
//
// Barrier: publishes a last frame, asks each participant for the CRC of what it shows, and collects
// the answers.
//
// Thread: every call on the I/O thread. `connections` and `inbox` outlive this.

#include <array>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/lesson/course.h"
#include "common/wire/recording_state.h"
#include "common/wire/surface_layout.h"
#include "server/session/replication/admission.h"
#include "server/session/replication/lesson_course.h"
#include "server/session/replication/marks.h"
#include "server/session/replication/returns.h"
#include "server/session/replication/teaching.h"
#include "server/session/replication/viewers.h"
#include "server/tissue/step/published_frame.h"

namespace trocar::proto {
class Hello;
class RelayReport;
}  // namespace trocar::proto

namespace trocar::replication {

struct BarrierResult {
  ParticipantSlot slot;
  std::string name;
  participants::Role role = participants::Role::Observer;
  bool has_answered = false;
  Frame frame = 0;  // acknowledged
  std::uint32_t surface_crc = 0;
  bool is_equal = false;
};

class Replicator final : private ViewerHost, private Audience {
 public:
  Replicator(net::Connections& connections, participants::SimulationInbox& inbox,
             wire::SurfaceLayout layout, std::string organ_name, std::uint64_t organ_hash,
             ReplicatorOptions options = {});

  // Connections are told to this.
  net::ConnectionHandler& handler() { return viewers_; }

  // Before the first connection: somebody who was in the session that this one goes on with, whose
  // tools the simulation has, and who may come back as after a loss. False: nobody may.
  // `code`: the number of the join code that they came with.
  bool restore(participants::Participant who, const participants::ReturnToken& token,
               std::uint32_t code = 0) {
    return returns_.restore(std::move(who), token, code);
  }

  // Frames since the last call, oldest first, none left out. Claim events and surface changes of
  // all of them are delivered, the displacements only of the newest.
  void publish(std::span<const step::SharedFrame> frames);

  // While no frame comes: sees to people, and gives the newest frame to who lacks it.
  void attend();

  // Everybody is told of another status at once, of more missing frames at most once a second; who
  // joins is told what it is.
  void set_recording(const wire::RecordingState& state);

  // `last` has been or is now published; no further publish(). New Hellos are refused.
  void begin_barrier(const step::SharedFrame& last);
  bool is_barrier_complete() const;  // everybody who is still here has answered
  // Returns an answer, or none, for each who was present when it began, by slot.
  const std::vector<BarrierResult>& barrier_results() const { return barrier_results_; }

  // Goodbye to everybody.
  void end_all(EndReason reason, const std::string& text);

  std::size_t session_count() const { return viewers_.connection_count(); }
  const participants::Roster& roster() const { return roster_; }
  const participants::Absences& absences() const { return returns_.absences(); }
  // Number of the join code that somebody came with; 0: none.
  std::uint32_t code_of(ParticipantSlot slot) const;
  const ReplicatorCounters& counters() const { return counters_; }
  const EncodeStatistics& encode_statistics() const { return viewers_.encoder().statistics(); }

 private:
  std::optional<Ending> heed(Viewer& viewer, const proto::Envelope& message) override;
  std::optional<Ending> heed_samples(const Viewer& viewer,
                                     const proto::ClientDatagram& datagram) override;
  void note_shown(const Viewer& viewer, const proto::FrameAck& ack) override;
  bool show(const Viewer& viewer) override;
  const wire::SharedBytes& topology() override;
  const std::vector<wire::SharedBytes>& fine_parts() const override {
    return options_.fine_surface;
  }
  std::uint64_t server_time_us() const override { return options_.clock_ns() / 1000; }
  bool keep(const Viewer& viewer) override;
  void forget(const Viewer& viewer, const Ending* ending) override;
  void settle() override;

  bool send(const Speaker& to, const wire::SharedBytes& bytes) override {
    return viewers_.send(to.id, bytes);
  }
  void broadcast(const wire::SharedBytes& bytes) override { viewers_.broadcast(bytes); }
  void offer(const wire::SharedBytes& bytes, const Speaker* but) override {
    viewers_.offer(bytes, but ? but->id : 0);
  }
  Speaker* find(ParticipantSlot slot) const override;
  void put_out(ParticipantSlot slot, const std::string& words) override;
  const step::SharedFrame& newest_frame() const override { return viewers_.newest(); }

  // These return what to end the client's session with, or nothing.
  std::optional<Ending> heed_hello(Viewer& viewer, const proto::Hello& hello);
  std::optional<Ending> come_back(Viewer& viewer, Speaker& who, ParticipantSlot slot);
  std::optional<Ending> welcome(Viewer& viewer, const Speaker& who);
  std::optional<Ending> heed_relay_report(Speaker& who, const proto::RelayReport& report);
  void say_bye(const Viewer& viewer);
  void tell_followed();

  // Tells everybody what begins an epoch and keeps it; an error if it does not follow.
  Status change_surface(const wire::SurfaceChange& change);
  // Gives up the places of those who are away for too long or are to go, and puts out the others
  // whose code was revoked.
  void attend_people();
  void leave(const Speaker& who);
  wire::SharedBytes participants_message() const;

  participants::SimulationInbox& inbox_;
  const ReplicatorOptions options_;
  const std::uint64_t organ_hash_;
  const std::string organ_name_;
  wire::SurfaceLayout layout_;  // of the newest frame
  wire::SharedBytes topology_;  // its encoding; null: not since the last change
  std::map<net::ConnectionId, std::unique_ptr<Speaker>> speakers_;  // from Hello on
  std::optional<std::uint64_t> participants_told_ns_;
  wire::RecordingState recording_{
      .status = wire::RecordingStatus::Off, .frames_missing = 0, .text = {}};
  std::uint64_t recording_told_ns_ = 0;
  ReplicatorCounters counters_;
  net::Connections& connections_;
  participants::Roster roster_;
  access::Door door_;
  SessionContext session_;
  Viewers viewers_;
  Returns returns_;
  Admission admission_;
  Hands hands_;
  Marks marks_;
  Pace pace_;
  Drawing drawing_;
  LessonCourse course_;
  Teaching teaching_;
  step::SharedFrame barrier_;
  std::vector<BarrierResult> barrier_results_;
};

}  // namespace trocar::replication
