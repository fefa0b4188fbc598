#pragma once

// A session's surface and lists as its messages tell them, so that somebody who comes late is shown
// everything at once. (The replica of a client, without what a picture needs.) A frame is the
// server's own, of which who watches needs no more: its tools and figures are in its FrameState.
//
// The last 64 frames are kept. Outside data: a message that does not fit makes the copy wait for a
// keyframe, which needs_keyframe() says once; a message that cannot be right is an error.
// Thread: one.

#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "common/wire/fine_surface.h"
#include "common/wire/framing.h"
#include "common/wire/surface_layout.h"
#include "server/tissue/step/published_frame.h"

namespace trocar::proto {
class Drawing;
class Envelope;
class FineSurfacePart;
class FrameAck;
class SurfaceChange;
class SurfaceFrame;
class SurfaceTopology;
}  // namespace trocar::proto

namespace trocar::follow {

// A message means one of these to those who watch.
enum class News {
  Nothing,
  Frame,       // there is another one to give
  WholeFrame,  // the state of the newest one has come, too
  Event,       // it goes to everybody, in order
  Fleeting,    // likewise, unless too much waits already
  NewSurface,  // likewise, and no frame before it is of use any more
  LastFrame,   // likewise, once the newest frame has been given
  FinePart     // there is another part of the fine surface to give
};

class SessionCopy {
 public:
  SessionCopy();
  ~SessionCopy();

  // `framed`: the same message with its length.
  Result<News> take(const proto::Envelope& message, const wire::SharedBytes& framed);
  // True once for each time that the session has to be asked for a keyframe.
  bool needs_keyframe();

  // There is a frame, and it is of the surface as it was told last.
  bool has_frame() const { return current_ != nullptr && current_->epoch == layout_.epoch; }
  // Only where there is a frame; before, null.
  const step::SharedFrame& newest() const { return current_; }
  std::uint64_t server_time_us() const { return server_time_us_; }  // of the newest frame
  // Says that the newest frame is here whole.
  void acknowledge(proto::FrameAck& ack) const;
  // The session's last, once it has said that.
  std::optional<Frame> last_frame() const { return last_frame_; }
  // FrameState of the newest frame; null: it has not come yet.
  const wire::SharedBytes& state() const { return state_; }

  // For who comes late, before the first frame: participants, surface, recording, drawing, pace,
  // marks, stage, view.
  std::vector<wire::SharedBytes> all_but_frames();
  const wire::SharedBytes& topology();
  // FineSurfacePart, as many as have come; a part at a time beside frames.
  const std::vector<wire::SharedBytes>& fine_parts() const { return fine_parts_; }
  bool has_all_fine_parts() const { return is_fine_whole_; }

 private:
  static constexpr std::size_t kKeptFrames = 64;
  // Fills the blood of `next` from that of its base (null: dry); false: the message is wrong.
  static bool take_blood(const proto::SurfaceFrame& message, const step::PublishedFrame* base,
                         step::PublishedFrame& next);

  Status take_topology(const proto::SurfaceTopology& message);
  bool take_change(const proto::SurfaceChange& message);
  bool take_frame(const proto::SurfaceFrame& message);
  void take_drawing(const proto::Drawing& message);
  Result<News> take_fine_part(const proto::FineSurfacePart& message,
                              const wire::SharedBytes& framed);
  const step::PublishedFrame* find(Frame frame) const;
  void lose_count();

  wire::SurfaceLayout layout_;
  bool has_layout_ = false, wants_keyframe_ = false, has_asked_ = false;
  std::string organ_name_;
  std::array<step::SharedFrame, kKeptFrames> kept_;  // by frame number
  step::SharedFrame current_;                        // null: waits for a keyframe
  std::uint64_t server_time_us_ = 0;
  wire::SharedBytes topology_, state_;  // null: not encoded, or not there
  wire::SharedBytes participants_, recording_, pace_, marks_, stage_, view_;
  std::unique_ptr<proto::Drawing> drawing_;
  wire::FinePartOrder fine_order_;
  bool is_fine_whole_ = false;
  std::vector<wire::SharedBytes> fine_parts_;
  std::optional<Frame> last_frame_;
};

}  // namespace trocar::follow
