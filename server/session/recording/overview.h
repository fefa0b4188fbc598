#pragma once

// Makes the Overview messages of a recording from what is recorded anyway: per bin of 256 ticks and
// tool the greatest force, the tip, its way and what it does, and all events. Frames come in order.
// A message ends where the frames of a whole bin were dropped. Bounds: 120 bins and 256 KiB of
// events a message; events beyond are counted. One thread.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/base/ids.h"
#include "common/base/tick.h"
#include "common/math/vec3.h"
#include "proto/journal.pb.h"
#include "server/session/participants/roster.h"
#include "server/tissue/step/published_frame.h"

namespace trocar::recording {

class OverviewBuilder {
 public:
  static constexpr Tick kBinTicks = 256;
  static constexpr std::uint32_t kMostBins = 120;
  static constexpr std::size_t kMostEventBytes = 256 * 1024;

  // begin: the tick after which the recording begins.
  explicit OverviewBuilder(Tick begin);

  // It is a tool in one frame.
  struct ToolMoment {
    ToolSlot tool;
    std::uint32_t verb = 0;  // as tool::Verb
    bool has_claim = false;
    Vec3f force_n, tip;  // world frame; the tip is the proxy's
  };

  // roster: names for claim events.
  void add_frame(const step::PublishedFrame& frame, const participants::Roster& roster);
  // The same in parts, of which the tools come last.
  void add_claim(const proto::ClaimEvent& event);
  void add_change(Tick tick);
  void add_tools(Tick tick, std::span<const ToolMoment> tools);
  void add_presence(Tick tick, const proto::Participants& present);
  void add_gap(const proto::JournalGap& gap);
  void add_lesson(const proto::TeachEvent& event);
  void add_stage(Tick tick, const proto::LessonStage& stage);
  // The gap ends behind the open bin: take() it, and skip_to() the gap's last tick.
  bool is_behind(Tick tick) const { return tick >= bin_end_; }
  void skip_to(Tick tick);

  // Its bins are all there: take() it before the next frame.
  bool is_full() const { return overview_.bins() >= kMostBins; }
  bool is_empty() const { return overview_.bins() == 0 && bin_tools_.empty() && event_bytes_ == 0; }
  // Returns what there is, with the bin that is open, and begins again after it.
  proto::Overview take();

 private:
  struct BinTool {
    ToolSlot tool;
    std::uint32_t state = 0;
    float force_n = 0, path_m = 0;
    Vec3f tip;
  };
  void close_bin();
  void begin_at(Tick tick);
  bool has_room(std::size_t bytes);

  proto::Overview overview_;
  std::array<int, kMaxTools> index_of_{};  // in overview_.tool, -1: none
  std::array<std::array<std::int32_t, 3>, kMaxTools> last_um_{};
  std::array<std::optional<Vec3f>, kMaxTools> last_tip_;  // of the frame before
  std::vector<BinTool> bin_tools_;                        // of the open bin
  Tick bin_end_ = 0;
  std::optional<Tick> last_change_;
  std::size_t event_bytes_ = 0;
};

}  // namespace trocar::recording
