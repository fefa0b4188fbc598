#pragma once

// The comparison behind verify_journal(): takes the messages of a recording one after another, in
// the order in which they were recorded, and keeps a simulation in step with them. One thread.

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/journal/session_journal.h"
#include "server/session/recording/frame_messages.h"
#include "server/session/recording/stored_surface.h"
#include "server/session/recording/verify.h"
#include "server/tissue/step/simulation.h"

namespace trocar::recording {

class Verifier {
 public:
  // The simulation is at its beginning. `report` says whether to simulate, and is filled.
  Verifier(const journal::SessionInfo& info, step::Simulation simulation, VerifyReport& report);
  ~Verifier();

  // Lists of participants of the whole recording, in order, and whether these are all: names and
  // tools are compared only then. Before the first check().
  void add_list(Tick tick, const proto::Participants& list);
  void set_all_lists(bool has_all) { has_all_lists_ = has_all; }

  // False once there is a difference.
  bool check(std::string_view topic, BytesView bytes);
  // This is called after the last message.
  void finish(const journal::McapReader& container);

 private:
  // The simulation expects these messages of a frame.
  struct Expected {
    std::string topic;
    std::unique_ptr<google::protobuf::Message> message;
  };
  class Collector;
  // Goes on from a snapshot beside the first simulation.
  struct Continuation {
    step::Simulation simulation;
    Tick tick = 0;   // of the snapshot
    Tick until = 0;  // hashes are compared up to here
  };
  struct List {
    Tick tick = 0;
    std::map<std::uint8_t, std::vector<tool::ToolShape>> tools;  // by slot; without watchers
  };

  bool waits_for_begin() const {
    return begins_with_snapshot_ && report_.is_resimulated && next_tick_ == begin_tick_ + 1 &&
           !is_in_step_;
  }
  void differ(Difference difference);
  void add_reason(std::string reason);
  void check_snapshot(const proto::WorldSnapshot& snapshot);
  void check_batch(const proto::TickBatch& batch);
  void check_record(const proto::TickRecord& message);
  void check_gap(const proto::JournalGap& gap);
  // Another server has gone on from the state after that tick.
  void check_join(Tick tick);
  void note_missing(Tick before);
  bool start_from_snapshot(Tick tick);
  // A journal that does not begin with the organ at rest begins with the state to go on from.
  void begin_from(const proto::WorldSnapshot& snapshot);
  // False: the snapshot is not the state that the simulation is in, which is told.
  bool is_state(const proto::WorldSnapshot& snapshot);
  void compare_snapshot(Tick tick);
  void continue_snapshots(std::uint64_t hash);
  void begin_frame(step::PublishedFrame& frame);
  void compare_participants(Tick tick);
  void check_surface(journal::JournalTopic topic, const google::protobuf::Message& message);
  void compare(std::string_view topic, const google::protobuf::Message& recorded);
  void end_frame();

  const journal::SessionInfo& info_;
  VerifyReport& report_;
  bool is_older_ = false;  // of an older protocol
  step::Simulation simulation_;
  FrameMessages messages_;
  participants::Roster roster_;  // names for claim events
  StoredSurface surface_;
  std::vector<List> lists_;
  bool has_all_lists_ = true;
  step::TickRecord record_;
  std::vector<step::TickRecord> records_;                      // since the last frame
  std::unique_ptr<google::protobuf::Message> first_topology_;  // until there is that state
  Tick next_tick_ = 1;                              // of the record that should come next
  Tick begin_tick_ = 0;                             // after which it begins, or went on at a join
  bool begins_with_snapshot_ = false;               // the state after begin_tick_ is one
  bool knows_begin_ = false;                        // and it was simulated, too
  bool is_in_step_ = true;                          // the simulation is where the recording is
  bool is_frame_whole_ = true;                      // simulated in full since the last one
  bool has_key_schedule_ = true;                    // it is known when keyframes are due
  std::map<Tick, proto::WorldSnapshot> snapshots_;  // of ticks to come
  std::vector<Continuation> continuations_;
  std::vector<Expected> expected_;  // of the newest frame, what the recording has not shown yet
  bool is_comparing_ = false;       // what the recording has is in expected_, or too much
  Tick frame_tick_ = 0;             // of expected_
  bool has_frame_ = false;          // of the simulation, at frame_tick_
  std::uint32_t frame_crc_ = 0;
  std::uint64_t not_compared_ = 0;  // messages of frames that were not simulated
  Tick gap_end_ = 0;                // the last tick of the last gap that is marked
  std::map<std::string, std::uint64_t, std::less<>> message_counts_;  // by topic
};

}  // namespace trocar::recording
