#pragma once

// Instruments that peers hold: the newest TRANSFORM of a device is where the instrument is, and a
// STRING of that name says what it does: none, push, grasp or cut. Until then it does what it is
// for, if that is to push, and else nothing.
//
// The peer whose device moves it first holds it until it goes; then it lets go of everything.
// Samples leave at most every 4 ms, however often a peer says where it is, and every 40 ms while it
// stays there. Thread: one.

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client/replica/session_source.h"
#include "client/slicer/frames.h"
#include "client/slicer/peers.h"
#include "common/tool/tool.h"

namespace trocar::slicer {

struct TrackedTool {
  std::string device;
  tool::ToolShape shape;
};

class TrackedTools {
 public:
  explicit TrackedTools(std::span<const TrackedTool> tools);

  std::vector<tool::ToolShape> shapes() const;
  bool has(const std::string& device) const;
  // Error, without the message's name: Frames::from_ras, or another peer holds it.
  Status move(const std::string& device, PeerId peer, const Transform& transform,
              const Frames& frames);
  // Error: likewise, or it is no verb, or none that the instrument can do.
  Status use(const std::string& device, PeerId peer, const std::string& verb);
  void let_go(PeerId peer);
  // In another session nobody has moved any.
  void begin_anew();
  void send_due(replica::SessionSource& source, std::uint64_t now_ns);

 private:
  struct Held {
    TrackedTool tool;
    tool::ToolSample sample;
    std::optional<PeerId> holder;
    bool has_place = false;  // it was moved
    bool has_news = false;
    std::uint64_t sent_ns = 0;
  };
  Result<Held*> take(const std::string& device, PeerId peer);

  std::vector<Held> held_;
  std::uint32_t sequence_ = 0;
};

}  // namespace trocar::slicer
