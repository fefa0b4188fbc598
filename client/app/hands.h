#pragma once

// The tools this client brings: a person's mouse, devices that feel, or a script, and when their
// samples leave. Those of devices leave by line(), beside all others. Thread: render thread.

#include <memory>
#include <optional>
#include <vector>

#include "client/app/felt_replay.h"
#include "client/device/mouse_tool.h"
#include "client/device/script_hand.h"
#include "client/replica/hand_echo.h"
#include "client/replica/hand_line.h"
#include "client/replica/replica.h"

namespace trocar::app {

class Hands {
 public:
  // No hands at all: a watcher.
  Hands() = default;
  static Hands mouse(const tool::ToolShape& shape);
  static Hands scripted(tool::Script script);
  // Each device holds one tool; there are at most two.
  static Hands felt(std::vector<std::unique_ptr<FeltHand>> hands);

  // These feel what was recorded; they hold no tools.
  static Hands replayed(std::vector<std::unique_ptr<FeltReplay>> hands);

  // Returns the tools to offer when joining.
  std::vector<tool::ToolShape> shapes() const;
  const std::vector<std::unique_ptr<FeltHand>>& felt() const { return felt_; }
  // Returns those of all hands that feel, by number.
  std::vector<FeltFigures> figures() const;
  // From now on no hand feels anything. What each did, by number; null: it was not to be kept.
  std::vector<const haptics::Trace*> let_go();
  // Between the devices and a source; null: there are none. It stays where it is.
  replica::HandLine* line() { return line_.get(); }
  // How the person looks at the scene: devices move tools as they are seen.
  void set_view(const Quatf& world_from_camera);
  device::MouseTool* mouse_tool() { return mouse_ ? &*mouse_ : nullptr; }

  // Sends what is due, and starts devices. A script begins with the first frame this client shows
  // and runs in simulated time, so that it is the same script on a server that cannot keep up. An
  // error means that it does not fit the organ.
  Status send_due(const replica::Replica& replica, replica::SessionSource& source,
                  std::uint64_t now_ns);
  // Takes note of the first tool's position in each frame; the time since it was sent, in ms.
  // `likely_ns`: see HandEcho.
  std::optional<double> observe_echo_ms(const replica::Replica& replica, std::uint64_t likely_ns,
                                        std::uint64_t now_ns);

 private:
  // Simulated seconds since the script began; never goes back.
  double script_seconds(const replica::SessionFrame& newest, std::uint64_t now_ns);
  void send(replica::SessionSource& source, std::uint32_t tool, const tool::ToolSample& sample,
            std::uint64_t now_ns);
  Status tend_felt(const replica::Replica& replica);

  std::vector<std::unique_ptr<FeltHand>> felt_;
  std::unique_ptr<replica::HandLine> line_;
  std::vector<std::unique_ptr<FeltReplay>> replayed_;
  std::optional<device::MouseTool> mouse_;
  tool::ToolShape mouse_shape_;
  std::optional<tool::Script> script_;  // until the surface is known
  std::optional<device::ScriptHand> script_hand_;
  std::vector<tool::ToolShape> script_shapes_;
  Tick script_start_tick_ = 0;
  double script_seconds_ = 0;
  std::uint64_t script_sent_ns_ = 0;
  std::uint32_t sequence_ = 0;
  replica::HandEcho echo_;
};

}  // namespace trocar::app
