#pragma once

// Those who are connected to a session, and the picture that each of them is given: by the server
// to its clients (replicator.h), by a relay to who watches there, and by a page to its browsers
// (server/watch/crowd). Who they are and what else they may say is the business of a ViewerHost.
//
//   open -> Hello, which the host heeds -> welcome -> begin: all that there is to see, a frame
//        -> then per published frame the newest, as its own frame_feed.h decides, and one part of
//           the fine surface beside it (part_pacer.h)
//
// Acknowledgements, requests for keyframes (at most 4 a second are met, with the topology before
// them from epoch 1 on), pings and a flood of messages are answered here, alike for all. A message
// that cannot be skipped and does not fit ends the session of that viewer alone, as too slow.
//
// Guests of a carrier (server/watch/crowd) are let in one by one; what is for everybody goes to the
// carrier, once. It says nothing for itself but of the picture.
//
// Thread: the I/O thread.

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/session/net/connections.h"
#include "server/session/pacing/allowance.h"
#include "server/session/pacing/part_pacer.h"
#include "server/session/replication/frame_encoder.h"
#include "server/session/replication/frame_feed.h"
#include "server/session/replication/replicator_options.h"

namespace trocar::proto {
class ClientDatagram;
class Envelope;
class FrameAck;
}  // namespace trocar::proto

namespace trocar::replication {

struct Viewer {
  Viewer(net::Connections& connections, net::ConnectionId its_id, const ReplicatorOptions& options,
         ReplicatorCounters& counters);

  // True for who is to have the picture.
  bool is_shown() const { return is_carrier || (is_welcome && carrier == 0); }
  // True for who has it, and is told what everybody is told.
  bool listens() const { return has_begun && is_shown(); }

  const net::ConnectionId id;
  const net::ConnectionId carrier;  // of a guest, else 0
  bool is_carrier = false;          // it has carried a guest who was welcome
  bool is_welcome = false;
  bool has_begun = false;  // it has been shown everything
  bool has_sent_datagrams = false;
  FrameFeed feed;
  pacing::PartPacer fine_parts;       // of the fine surface
  pacing::Allowance messages, bytes;  // that it may send
};

class ViewerHost {
 public:
  virtual ~ViewerHost() = default;
  // Takes what Viewers do not answer; of who is not welcome, Hello alone. Returns what to end the
  // viewer's session with, or nothing.
  virtual std::optional<Ending> heed(Viewer& who, const proto::Envelope& message) = 0;
  virtual std::optional<Ending> heed_samples(const Viewer& who,
                                             const proto::ClientDatagram& datagram) = 0;
  // Hears that `who`, or those whom it carries, show a frame that they were given.
  virtual void note_shown(const Viewer& who, const proto::FrameAck& ack) = 0;
  // Sends everything that there is to see, but frames; false: there is no room for it.
  virtual bool show(const Viewer& who) = 0;
  virtual const wire::SharedBytes& topology() = 0;
  virtual const std::vector<wire::SharedBytes>& fine_parts() const = 0;
  // 0: it is not known, and pings are the host's to heed.
  virtual std::uint64_t server_time_us() const = 0;
  // The connection is lost. True: whoever it was may come back, and is not to be forgotten.
  virtual bool keep(const Viewer& who) = 0;
  // `ending`: what it was told; null: it has gone by itself.
  virtual void forget(const Viewer& who, const Ending* ending) = 0;
  // Comes after each thing that a viewer has said or done.
  virtual void settle() {}
};

class Viewers final : public net::ConnectionHandler {
 public:
  // All references outlive this.
  Viewers(net::Connections& connections, ViewerHost& host, const ReplicatorOptions& options,
          ReplicatorCounters& counters);

  // Says the framed Welcome and, if there is a picture, shows it.
  std::optional<Ending> welcome(Viewer& who, const wire::SharedBytes& words, bool has_picture);
  // Null: nobody has that number.
  Viewer* find(net::ConnectionId id) const;
  // False: there is no room for it, or nobody of that number.
  bool send(net::ConnectionId to, const wire::SharedBytes& bytes);
  // Tells everybody. The session ends of who has no room for it.
  void broadcast(const wire::SharedBytes& bytes);
  // Tells everybody, but `but`, who has room for it.
  void offer(const wire::SharedBytes& bytes, net::ConnectionId but = 0);
  // A small message that the next one makes stale goes the way of frames.
  void give_beside(net::ConnectionId to, const wire::SharedBytes& message);

  // Tells everybody what begins this epoch of the surface.
  void change_surface(std::uint32_t epoch, const wire::SharedBytes& framed);
  // Another surface, to which no change leads: everybody gets it and a keyframe. No frame before
  // `first_useful` helps any more.
  void replace_surface(const wire::SharedBytes& topology, Frame first_useful);
  // `state`: see frame_encoder.h.
  void set_frame(step::SharedFrame frame, std::uint64_t server_time_us,
                 wire::SharedBytes state = nullptr);
  // The newest frame for who lacks it, everything for who waits for that, fine parts.
  void give_all();
  // The last frame goes to everybody, and `barrier` after it.
  void give_last(const wire::SharedBytes& barrier);
  // Frames of before are no base any more: everybody is cut, and comes back by himself.
  void restart();
  // Whoever has fewer fine parts than `all` gets them from the first one on.
  void begin_fine_parts(std::size_t all);

  void end(net::ConnectionId id, const Ending& ending);
  void end_all(const Ending& ending);
  // Goes as it came, without a word: after its own, or in favour of another connection.
  void close(net::ConnectionId id, bool is_flushed);

  const FrameEncoder& encoder() const { return encoder_; }
  const step::SharedFrame& newest() const { return encoder_.current(); }
  std::size_t connection_count() const { return viewers_.size(); }
  std::size_t welcome_count() const;

  void on_open(net::ConnectionId id) override;
  void on_message(net::ConnectionId id, BytesView message) override;
  void on_datagram(net::ConnectionId id, BytesView message) override;
  void on_fault(net::ConnectionId id, net::ConnectionFault fault) override;
  void on_close(net::ConnectionId id) override;

 private:
  std::unique_ptr<Viewer> take_out(net::ConnectionId id);
  std::optional<Ending> handle(Viewer& who, BytesView bytes);
  std::optional<Ending> handle_datagram(Viewer& who, BytesView bytes);
  void want_keyframe(Viewer& who);
  // False: the server's clock is not known.
  bool answer_ping(const Viewer& who, std::uint64_t client_time_us);
  std::optional<Ending> check_rate(Viewer& who, std::size_t bytes);
  std::optional<Ending> check_guest(const Viewer& guest);
  std::optional<Ending> take_ack(Viewer& who, const proto::FrameAck& ack);
  bool begin(Viewer& who);
  // True if it has the newest frame afterwards, or it is on its way. `is_required`: do not skip.
  bool give(Viewer& who, bool is_required);
  void give_fine_part(Viewer& who);
  void end_slow(const std::vector<net::ConnectionId>& slow, const char* text);

  net::Connections& connections_;
  ViewerHost& host_;
  const ReplicatorOptions& options_;
  ReplicatorCounters& counters_;
  std::map<net::ConnectionId, std::unique_ptr<Viewer>> viewers_;
  FrameEncoder encoder_;
};

}  // namespace trocar::replication
