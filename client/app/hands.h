#pragma once

// The tools this client brings: a person's mouse, devices that feel, or a script, and when their
// samples leave. Those of devices leave by line(), beside all others. Thread: render thread.

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "client/app/felt_replay.h"
#include "client/app/script_clock.h"
#include "client/device/mouse_tool.h"
#include "client/device/script_hand.h"
#include "client/replica/hand_echo.h"
#include "client/replica/hand_line.h"
#include "client/replica/replica.h"
#include "common/tool/instrument.h"

namespace trocar::app {

class Hands {
 public:
  // No hands at all: a watcher.
  Hands() = default;
  // One or two hands of a person with a mouse, one of which moves; each has an instrument of the
  // table, which has to live on: `first` of it, at first.
  static Hands mouse(std::span<const tool::Instrument> table, const tool::Instrument& first,
                     int count);
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
  // The hand that the pointer moves, or null.
  device::MouseTool* mouse_tool() { return mouse_.empty() ? nullptr : &mouse_[moved_].tool; }
  // The hand with this number, or null.
  const device::MouseTool* mouse_tool(int number) const;
  struct Choice {
    std::span<const tool::Instrument> table;
    std::size_t chosen = 0;  // by the hand that moves
    std::size_t hand = 0, hands = 0;
  };
  // Returns that of a mouse; no hands: there is none.
  Choice choice() const;
  // The hand that moves takes another instrument. A wish that cannot be sent is lost.
  void take(std::size_t instrument, replica::SessionSource& source);
  // The pointer moves the person's other hand.
  void switch_hand(const device::PointerInput& input, const device::ViewRays& view);

  bool has_script() const { return script_ || script_hand_; }
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
  void send_script(const replica::SessionFrame& newest, replica::SessionSource& source,
                   std::uint64_t now_ns);
  void send(replica::SessionSource& source, std::uint32_t tool, const tool::ToolSample& sample,
            std::uint64_t now_ns);
  Status tend_felt(const replica::Replica& replica);

  std::vector<std::unique_ptr<FeltHand>> felt_;
  std::unique_ptr<replica::HandLine> line_;
  std::vector<std::unique_ptr<FeltReplay>> replayed_;
  struct MouseHand {
    device::MouseTool tool;
    std::size_t instrument = 0;
    std::vector<tool::ToolShape> asked;       // for these, and the list has not had them yet
    std::optional<tool::ToolShape> listed{};  // as the session had it last
  };
  // A hand that was given another instrument has it from then on.
  void take_what_is_listed(const replica::Replica& replica);
  std::vector<MouseHand> mouse_;
  std::size_t moved_ = 0;  // of them
  std::span<const tool::Instrument> table_;
  std::optional<tool::Script> script_;  // until the surface is known
  std::optional<device::ScriptHand> script_hand_;
  std::vector<tool::ToolShape> script_shapes_;
  ScriptClock script_clock_;
  double script_sent_seconds_ = 0;  // simulated
  std::uint64_t script_sent_ns_ = 0;
  std::uint32_t sequence_ = 0;
  replica::HandEcho echo_;
};

}  // namespace trocar::app
