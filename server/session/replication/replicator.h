#pragma once

// The sessions of all clients: who they are, what they may say, and what each was given last.
//
//   Hello -> Welcome, Participants, SurfaceTopology, keyframe -> then per published frame
//            SurfaceChange (where it begins an epoch), SurfaceFrame (delta against the last frame
//            this client was given, whichever epoch that was), FrameState
//
// Who joins passes the gate (server/session/access), if there is one, and then needs a place.
//
// Who has lost the connection without a Bye, and said in Hello that it can return, keeps the place
// for `return_seconds`: to the others, only the tools fall silent. A Hello with the token of
// Welcome and the same name gets the place back, even while the old connection still hangs. After
// that time the place is given up.
//
// Inbound: every message is checked by role and range (validation.h); samples, joins and leaves go
// to the simulation through the SimulationInbox. Anything malformed, oversized, too frequent or not
// this role's to say ends that session with a Goodbye that names the reason; nobody else notices.
//
// Outbound: a frame_feed.h per client decides which frames it is given and by which path. Who asks
// for a keyframe (at most 4 per second) gets the topology before it from epoch 1 on. Participants,
// claim events, surface changes, topology, recording state and barrier cannot be skipped: if one
// does not fit, the session ends as too slow.
//
// A message goes to the part that it is for: hands.h, teaching.h, marks.h, drawing.h,
// lesson_course.h. Parts speak to people through Audience, which this is.
//
// Guests of a carrier (server/watch/crowd) are let in as anybody is; what is for everybody goes
// to the carrier once instead of to each of them.
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
#include "server/session/participants/absences.h"
#include "server/session/replication/frame_encoder.h"
#include "server/session/replication/lesson_course.h"
#include "server/session/replication/marks.h"
#include "server/session/replication/teaching.h"
#include "server/tissue/step/published_frame.h"

namespace trocar::proto {
class Envelope;
class ClientDatagram;
class FrameAck;
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

class Replicator final : public net::ConnectionHandler, private Audience {
 public:
  Replicator(net::Connections& connections, participants::SimulationInbox& inbox,
             wire::SurfaceLayout layout, std::string organ_name, std::uint64_t organ_hash,
             ReplicatorOptions options = {});
  ~Replicator() override;

  // Before the first connection: somebody who was in the session that this one goes on with, whose
  // tools the simulation has, and who may come back as after a loss. False: nobody may.
  // `code`: the number of the join code that they came with.
  bool restore(participants::Participant who, const participants::ReturnToken& token,
               std::uint32_t code = 0);

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
  bool is_barrier_complete() const;                    // everybody who is still here has answered
  std::vector<BarrierResult> barrier_results() const;  // those present when it began, by slot

  // Goodbye to everybody.
  void end_all(EndReason reason, const std::string& text);

  std::size_t session_count() const { return clients_.size(); }
  const participants::Roster& roster() const { return roster_; }
  const participants::Absences& absences() const { return absences_; }
  // Number of the join code that somebody came with; 0: none.
  std::uint32_t code_of(ParticipantSlot slot) const;
  const ReplicatorCounters& counters() const { return counters_; }
  const EncodeStatistics& encode_statistics() const { return encoder_.statistics(); }

  void on_open(net::ConnectionId id) override;
  void on_message(net::ConnectionId id, BytesView message) override;
  void on_datagram(net::ConnectionId id, BytesView message) override;
  void on_fault(net::ConnectionId id, net::ConnectionFault fault) override;
  void on_close(net::ConnectionId id) override;

 private:
  struct Client;

  // These return what to end the client's session with, or nothing.
  std::optional<Ending> handle_message(Client& client, BytesView bytes);
  std::optional<Ending> admit(Client& client, const proto::Hello& hello);
  std::optional<Ending> find_place(Client& client, HelloRequest& request);
  std::optional<Ending> welcome(Client& client);
  // Gives the client all that there is to see; an ending: it does not fit.
  std::optional<Ending> show_all(Client& client);
  // Says of a guest's message what a connection of its own would not have said; nothing: go on.
  std::optional<Ending> check_guest(Client& guest, const proto::Envelope& message);
  std::optional<Ending> welcome_guest(Client& guest);
  // Handles what a carrier says for itself.
  std::optional<Ending> handle_carrier(Client& carrier, const proto::Envelope& message);
  std::optional<Ending> handle_relay_report(Client& client, const proto::RelayReport& report);
  void note_answer(ParticipantSlot slot, const proto::FrameAck& ack);
  // Returns the place to which this Hello comes back; null: there is none.
  const participants::Participant* find_own_place(const HelloRequest& request) const;
  std::optional<Ending> come_back(Client& client, const participants::Participant& place);
  // Keeps the place of who has lost the connection, if there is a way back.
  bool keep_place(Client& client);
  // Gives up the places of those who have been away for too long by then.
  void end_absences(std::uint64_t now_ns);
  // Ends the sessions of those whose code was revoked so that they have to go.
  void put_out_revoked();
  void refuse(Client& client, const std::string& reason);
  std::optional<Ending> handle_datagram(Client& client, const proto::ClientDatagram& datagram);
  Client* client_of(ParticipantSlot slot) const;
  std::optional<Ending> handle_ack(Client& client, const proto::FrameAck& ack);
  void tell_followed();
  // Ends the session of who sends too much.
  std::optional<Ending> check_rate(Client& client, std::size_t bytes);

  // Tells everybody what begins an epoch and keeps it; an error if it does not follow.
  Status change_surface(const wire::SurfaceChange& change);
  // Another one, to which no change leads: everybody gets it and a keyframe. No frame before
  // `frame` helps any more.
  void replace_surface(const wire::SurfaceLayout& layout, Frame frame);
  // Makes the message of the surface as it is now.
  const wire::SharedBytes& topology();

  bool send(const Speaker& to, const wire::SharedBytes& bytes) override;
  void broadcast(const wire::SharedBytes& bytes) override;
  void offer(const wire::SharedBytes& bytes, const Speaker* but) override;
  Speaker* find(ParticipantSlot slot) const override;
  void put_out(ParticipantSlot slot, const std::string& words) override;
  const step::SharedFrame& newest_frame() const override { return encoder_.current(); }

  // True if the client has the newest frame afterwards, or it is on its way. `is_required`: do not
  // skip.
  bool give_frame(Client& client, bool is_required);
  // Gives it the next part of the fine surface, if there is room (replicator_fine.cpp).
  void give_fine_surface(Client& client);
  // Tells it what its tools feel in the newest frame, if a hand feels them.
  void give_touch(Client& client);
  void end_session(Client& client, const Ending& ending);
  void leave(Client& client);
  void forget(Client& client);
  // After each change of who is here. Those who are here are told at once, but when many come and
  // go only every tenth of a second.
  void settle_participants();
  void tell_participants(std::uint64_t now_ns);

  net::Connections& connections_;
  participants::SimulationInbox& inbox_;
  const ReplicatorOptions options_;
  const std::uint64_t organ_hash_;
  const std::string organ_name_;
  wire::SurfaceLayout layout_;  // of the newest frame
  wire::SharedBytes topology_;  // its encoding; null: not since the last change
  participants::Roster roster_;
  participants::Absences absences_;
  std::map<net::ConnectionId, std::unique_ptr<Client>> clients_;
  std::map<ParticipantSlot, std::unique_ptr<Client>> away_;  // without a connection
  std::optional<std::uint64_t> participants_told_ns_;
  wire::RecordingState recording_{
      .status = wire::RecordingStatus::Off, .frames_missing = 0, .text = {}};
  std::uint64_t recording_told_ns_ = 0;
  ReplicatorCounters counters_;
  access::Door door_;
  SessionContext session_;
  Hands hands_;
  Marks marks_;
  Pace pace_;
  Drawing drawing_;
  LessonCourse course_;
  Teaching teaching_;
  FrameEncoder encoder_;
  step::SharedFrame barrier_;
  std::vector<BarrierResult> barrier_results_;
};

}  // namespace trocar::replication
