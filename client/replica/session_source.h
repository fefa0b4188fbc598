#pragma once

// A client's messages come from a source: a live server (client/net, NetSource) or a journal
// (client/replay, ReplaySource). The replica and the programs above it do not know which.
//
//   source's own thread                      render thread
//   socket or file -> bounded SPSC queue --> poll(sink) -> Replica, ...
//   socket         <- bounded SPSC queue <-- send(envelope)
//
// Thread: every member is called from one thread, the render thread. A source that has a thread of
// its own hands over through common/base/spsc_queue.h only. Nothing here blocks.
// Inbound queue full: the source stops reading (so TCP slows the server down, which then skips
// frames for this client); it never drops a message. Outbound queue full: send() returns false.
// Order: sink gets the messages of the stream as the server sent them, Welcome first; SurfaceSlice
// and FrameStatePart, which come as datagrams, in between, late or never. Goodbye is delivered like
// any other message before state() turns Closed; Ping and Pong are the source's own business.

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "common/base/tick.h"

namespace trocar::proto {
class Envelope;
}

namespace trocar::replica {

class MessageSink {
 public:
  virtual ~MessageSink() = default;
  // `arrival_ns` is monotonic_ns() when the last byte came in (a replay: when it fell due); `bytes`
  // what it took on the wire, length prefix included.
  virtual void on_message(const proto::Envelope& message, std::uint64_t arrival_ns,
                          std::size_t bytes) = 0;
};

enum class SourceState : std::uint8_t {
  Connecting,  // nothing heard yet
  Live,        // Welcome was received (a replay: the file is open)
  Away,        // the connection broke and is being made again; Live with the next Welcome
  Closed,      // no message will follow, all that came were delivered; `close_reason()` says why
};

enum class CloseKind : std::uint8_t {
  None,         // not closed
  Ended,        // Goodbye with GOODBYE_SERVER_CLOSING, or our own close(): exit 0
  Refused,      // any other Goodbye, or a server of another version: exit 4
  Unreachable,  // no connection could be made: exit 5
  Lost,         // connection broke for good, or bytes that are not our protocol: exit 5
};
struct CloseReason {
  CloseKind kind = CloseKind::None;
  std::string text;  // one line for a person: what, where, what to do
};

struct SourceStatistics {
  std::uint64_t bytes_received = 0;  // length prefixes included
  std::uint64_t bytes_sent = 0;
  std::uint64_t messages_received = 0;
  std::uint64_t frames_received = 0;       // SurfaceFrame messages
  std::uint64_t sends_dropped = 0;         // outbound queue was full
  double round_trip_seconds = 0;           // last Ping to Pong; 0 before the first
  double shortest_round_trip_seconds = 0;  // of the last 16
  std::uint64_t datagram_bytes_received = 0, datagram_bytes_sent = 0;  // sealed
  std::uint64_t datagrams_received = 0, datagrams_lost = 0;  // on the way here, of one connection
  std::uint64_t slices_received = 0;                         // SurfaceSlice messages
  std::uint64_t hand_messages_refused = 0;  // parts of what hands feel that were not as they may be
  bool has_server_clock = false;            // the offset is known
  double server_offset_us = 0;              // the server's monotonic clock less this client's
  std::uint64_t returns = 0;                // after the connection broke
  double longest_away_seconds = 0;          // of all absences, with the present one
  double away_seconds = 0;                  // of the present one; 0 unless Away
  double away_left_seconds = 0;             // until it is given up
};

enum class PlaybackEventKind : std::uint8_t { Person, Grasp, Cut, Refusal, Lesson, Gap };
struct PlaybackEvent {
  Tick tick = 0;
  PlaybackEventKind kind = PlaybackEventKind::Person;
  std::string text;  // one line for people
};
// This is what happened in a recording.
struct PlaybackStory {
  std::vector<PlaybackEvent> events;  // by tick
  // The greatest force on any tool, N, in equal parts of the time from tick 0 to the last.
  std::vector<float> forces_n;
};

// Controls of a recorded source. Seeking delivers, in the following polls, a SurfaceTopology when
// the epoch differs, a keyframe at or before the target and what follows up to it; frame numbers
// may so go back. At the end it pauses and stays Live.
class PlaybackControl {
 public:
  virtual ~PlaybackControl() = default;
  virtual Tick first_tick() const = 0;
  virtual Tick last_tick() const = 0;
  virtual Tick position() const = 0;  // tick up to which messages were delivered
  virtual bool is_playing() const = 0;
  virtual float speed() const = 0;  // simulated seconds per second, 0.1 to 16
  virtual void play() = 0;          // at the end: from the start again
  virtual void pause() = 0;
  virtual void seek(Tick tick) = 0;  // clamped to the range; keeps playing or paused
  virtual void set_speed(float speed) = 0;
  // Null while the recording is still searched.
  virtual std::shared_ptr<const PlaybackStory> story() const = 0;
};

class SessionSource {
 public:
  virtual ~SessionSource() = default;

  // Delivers everything that has arrived (a live source) or fallen due (a recorded one).
  virtual void poll(MessageSink& sink) = 0;
  // Queues a message to the server: ToolSample, KeyframeRequest, FrameAck. False if it was dropped:
  // not Live, or the queue is full. A recorded source swallows everything and returns true.
  virtual bool send(const proto::Envelope& message) = 0;
  // Says Bye with this reason if connected, then closes within 200 ms. state() turns Closed.
  virtual void close(const std::string& reason) = 0;

  virtual SourceState state() const = 0;
  virtual CloseReason close_reason() const = 0;
  virtual SourceStatistics statistics() const = 0;
  // The window's title names the source by this text: "127.0.0.1:7690" or a file's name.
  virtual std::string name() const = 0;
  // The pointer is null for a live source.
  virtual PlaybackControl* playback() { return nullptr; }
};

}  // namespace trocar::replica
