#pragma once

// A session that is followed is shown to many: what it tells goes to everybody in order, and each
// is given the frames that his connection takes (server/session/replication/viewers.h). Nothing is
// asked of the session when somebody comes.
//
//   session --messages--> SessionCopy --> events to everybody, in order
//                                    \--> frames, encoded for each by what he has
//
// A frame is given once its FrameState is there; one that has none is left out, unless it is the
// last. Whoever comes while the surface has just changed is shown it with the next frame. Who is
// let in, and what else he may say, is for whoever derives from this: crowd.h, page/carrier.h.
//
// Thread: one. `connections` and `counters` outlive this.

#include <functional>
#include <memory>

#include "server/session/replication/viewers.h"
#include "server/watch/follow/session_copy.h"

namespace trocar::crowd {

class Show : protected replication::ViewerHost {
 public:
  using SayUp = std::function<void(const proto::Envelope&)>;

  // `limits`: of messages and frames; places do not count. `say_up` sends a message to the session.
  Show(net::Connections& connections, replication::ReplicatorOptions limits,
       replication::ReplicatorCounters& counters, SayUp say_up);

  // A message of the session. An error: it cannot be right, and nothing fits any more.
  Status take(const proto::Envelope& message, const wire::SharedBytes& framed);
  // For those who were busy; several times a second.
  void give_all();

  // Connections are told to this.
  net::ConnectionHandler& handler() { return viewers_; }
  // True once there is a picture for who comes.
  bool has_picture() const;
  const wire::SharedBytes& topology() override { return copy_->topology(); }

 protected:
  const replication::ReplicatorOptions& limits() const { return limits_; }
  const follow::SessionCopy& copy() const { return *copy_; }
  replication::Viewers& viewers() { return viewers_; }
  const replication::Viewers& viewers() const { return viewers_; }
  void say_up(const proto::Envelope& message) const { say_up_(message); }
  bool has_frame_since_begin() const { return !is_new_; }
  // The session lets this in again: everything comes anew.
  void begin_anew();
  // Frames of before are no base for those that come now: everybody is cut, and begins anew.
  virtual void restart() { viewers_.restart(); }
  // Who is not told a message that is for the others; 0: it is for everybody.
  virtual net::ConnectionId but(const proto::Envelope&) const { return 0; }

 private:
  bool show(const replication::Viewer& who) override;
  const std::vector<wire::SharedBytes>& fine_parts() const override { return copy_->fine_parts(); }
  bool keep(const replication::Viewer&) override { return false; }

  // The newest frame is whole. `state`: its FrameState; null: it has none.
  void publish(const wire::SharedBytes& state);
  void acknowledge();

  const replication::ReplicatorOptions limits_;
  replication::ReplicatorCounters& counters_;
  const SayUp say_up_;
  std::unique_ptr<follow::SessionCopy> copy_;
  replication::Viewers viewers_;
  bool is_new_ = false;  // no frame has come since everything came anew
};

}  // namespace trocar::crowd
