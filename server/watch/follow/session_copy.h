#pragma once

// A session's surface and lists as its messages tell them, so that somebody who comes late is shown
// everything at once, and somebody who is slow gets a difference from what he has instead of all
// that came since. (The replica of a client, without what a picture needs.)
//
// The last 64 frames are kept. What goes to several is encoded once. Outside data: a message that
// does not fit makes the copy wait for a keyframe, which needs_keyframe() says once; a message that
// cannot be right is an error. Thread: one.

#include <array>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "common/base/tick.h"
#include "common/wire/blood_codec.h"
#include "common/wire/fine_surface.h"
#include "common/wire/framing.h"
#include "common/wire/surface_layout.h"

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
  // These are of the newest frame.
  Frame frame() const { return current_->frame; }
  Tick tick() const { return current_ ? current_->tick : 0; }
  std::uint32_t epoch() const { return current_->epoch; }
  std::uint64_t server_time_us() const { return current_->server_time_us; }
  std::uint32_t surface_crc() const { return current_->surface_crc; }
  const wire::QuantisedSurface& surface() const { return current_->surface; }
  // Says that the newest frame is here whole.
  void acknowledge(proto::FrameAck& ack) const;
  // Empty where the session does not bleed.
  const wire::BloodLevels& blood() const { return current_->blood; }
  // The session's last, once it has said that.
  std::optional<Frame> last_frame() const { return last_frame_; }
  wire::SharedBytes keyframe();
  // The newest frame as a difference from `base`, or whole where there is no way from that.
  wire::SharedBytes frame_from(std::optional<Frame> base);
  // Null: `base` is not kept, or it is of another surface.
  wire::SharedBytes delta_from(Frame base);
  // FrameState; null: it has not come yet.
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
  struct Kept {
    Frame frame = 0;
    Tick tick = 0;
    std::uint32_t epoch = 0, surface_crc = 0;
    std::uint64_t server_time_us = 0;
    wire::QuantisedSurface surface;
    wire::BloodLevels blood;  // empty: the session does not bleed
  };
  // Fills the blood of `next` from that of its base (null: dry); false: the message is wrong.
  static bool take_blood(const proto::SurfaceFrame& message, const Kept* base, Kept& next);

  Status take_topology(const proto::SurfaceTopology& message);
  bool take_change(const proto::SurfaceChange& message);
  bool take_frame(const proto::SurfaceFrame& message);
  void take_drawing(const proto::Drawing& message);
  Result<News> take_fine_part(const proto::FineSurfacePart& message,
                              const wire::SharedBytes& framed);
  const Kept* find(Frame frame) const;
  void lose_count();
  wire::SharedBytes wrap(const Kept* base, const Bytes& payload) const;

  wire::SurfaceLayout layout_;
  bool has_layout_ = false, wants_keyframe_ = false, has_asked_ = false;
  std::string organ_name_;
  std::array<std::shared_ptr<Kept>, kKeptFrames> kept_;  // by frame number
  std::shared_ptr<Kept> current_;                        // null: waits for a keyframe
  wire::SharedBytes topology_, keyframe_, state_;        // null: not encoded, or not there
  std::map<Frame, wire::SharedBytes> deltas_;            // by base
  wire::SharedBytes participants_, recording_, pace_, marks_, stage_, view_;
  std::unique_ptr<proto::Drawing> drawing_;
  wire::FinePartOrder fine_order_;
  bool is_fine_whole_ = false;
  std::vector<wire::SharedBytes> fine_parts_;
  std::optional<Frame> last_frame_;
};

}  // namespace trocar::follow
