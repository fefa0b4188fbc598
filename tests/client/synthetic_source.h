#pragma once

// A session without a server: encodes frames of a surface that we deform by formula, as the server
// would. Tests damage what it delivers and look at what it was sent.

#include <functional>
#include <vector>

#include "client/replica/session_source.h"
#include "common/base/ids.h"
#include "common/base/tick.h"
#include "common/math/frame.h"
#include "common/wire/surface_layout.h"
#include "proto/wire.pb.h"

namespace trocar::testing {

// A closed sphere-like blob as an organ without tets (surface only).
wire::SurfaceLayout make_blob_layout(int rings, int segments, double radius_m);

class SyntheticSource final : public replica::SessionSource {
 public:
  explicit SyntheticSource(wire::SurfaceLayout layout, std::string organ_name = "blob");

  // Messages of the next frame, as the server would send them; poll() delivers them.
  void queue_start();
  void queue_frame(bool as_keyframe = false);
  // Begins an epoch: the change goes out now, as the server sends it, its first frame is the next.
  void queue_change(const wire::SurfaceChange& change);
  // Queues what a server sends to a client that has lost count: the topology now, a keyframe next.
  void queue_topology();
  const wire::SurfaceLayout& layout() const { return layout_; }
  void queue(proto::Envelope message) { queued_.push_back(std::move(message)); }
  // In real time: poll() queues the frames that have fallen due since the first poll.
  void run_in_real_time() { is_real_time_ = true; }

  Frame frame() const { return frame_; }
  const wire::QuantisedSurface& surface() const { return surface_; }
  // Changes a message just before delivery; false drops it.
  std::function<bool(proto::Envelope&)> tamper;
  // Displacement of a vertex on top of that by the two tools, m.
  std::function<Vec3f(std::size_t slot, const Vec3f& rest)> also_move;
  std::vector<proto::Envelope> sent;  // by the client, in order
  bool answer_requests = true;  // KeyframeRequest gets topology and keyframe with the next frame

  void poll(replica::MessageSink& sink) override;
  bool send(const proto::Envelope& message) override;
  void close(const std::string& reason) override;
  replica::SourceState state() const override { return state_; }
  replica::CloseReason close_reason() const override { return reason_; }
  replica::SourceStatistics statistics() const override { return statistics_; }
  std::string name() const override { return "synthetic"; }

 private:
  void deform();
  void follow_layout();
  proto::Envelope make_state() const;

  wire::SurfaceLayout layout_;
  std::string organ_name_;
  std::vector<Vec3f> rest_;
  wire::QuantisedSurface surface_;
  std::vector<std::uint16_t> regions_;
  Frame frame_ = 0;
  bool wants_keyframe_ = false, wants_topology_ = false, is_real_time_ = false,
       has_started_ = false;
  std::uint64_t start_ns_ = 0;
  std::vector<proto::Envelope> queued_;
  replica::SourceState state_ = replica::SourceState::Live;
  replica::CloseReason reason_;
  replica::SourceStatistics statistics_;
  Pose tool_poses_[2];
  Pose mouse_pose_;
  int mouse_verb_ = 0;
  bool has_mouse_ = false;
};

}  // namespace trocar::testing
