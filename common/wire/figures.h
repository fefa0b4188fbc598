#pragma once

// Every figure that a session tells people is declared here, once: the tick fills it, the frame,
// the wire and the recording carry it, the panels show it. common/wire/figure_messages.h has its
// form on the wire, and tests/wire/figures_test.cpp fails for a figure that does not arrive.

#include <array>
#include <cstdint>
#include <optional>

namespace trocar::wire {

// A tick has these stages, each with its times.
enum class Stage { Admit, Contacts, Queue, Solve, Cut, Claims, Hash, Publish, Bleed };
inline constexpr std::size_t kStageCount = 9;
const char* name_of(Stage stage);

// These layers have sweeps of their own: touched nodes, layer 1, layer 2, all active ones beyond.
inline constexpr std::size_t kSweepLayers = 4;
using LayerCounts = std::array<std::uint32_t, kSweepLayers>;

// These nodes are worked on most.
struct NearFigures {
  std::uint32_t active_nodes = 0;  // the queue and nodes that have not come to rest
  std::uint32_t queue_nodes = 0;   // that the propagation reached
  std::uint32_t node_limit = 0;    // the most that the queue may have; 0: not told
  std::uint32_t region_count = 0;

  bool operator==(const NearFigures&) const = default;
};

// These figures say what one tick's solve took and came to.
struct SolveFigures {
  std::uint32_t sweeps = 0, far_sweeps = 0;  // of active nodes and of all others
  std::uint32_t far_interval = 1;            // ticks for which these far sweeps are
  LayerCounts layer_sweeps{};                // of active nodes, as decided; 0: not told
  float residual_n = 0;  // root mean square force imbalance of active nodes in the last sweep

  bool operator==(const SolveFigures&) const = default;
};

// These are sums over all tissue that relaxes; each tet counts as when it was last advanced.
struct RelaxationFigures {
  double energy_j = 0;       // elastic, as if nothing had relaxed
  double volume_change = 0;  // of the whole, over its volume without stress; a float on the wire
  // The share is of the stress that there would be at once; over 1 means that tissue remembers more
  // stress than it has, as when it has just been let go. It is a float on the wire.
  double relaxed_share = 0;

  bool operator==(const RelaxationFigures&) const = default;
};

// These say what has bled, in a session that does. Volumes are whole nanolitres, rounded down, of
// sums that are exact: shed = on the surface + dripped + sucked.
struct BloodFigures {
  std::uint64_t shed_nl = 0;        // out of wounds and vessels: the loss
  std::uint64_t on_surface_nl = 0;  // lies or runs there
  std::uint64_t dripped_nl = 0;     // has fallen off
  std::uint64_t sucked_nl = 0;
  std::uint64_t rate_nl_s = 0;     // that is shed now
  std::uint32_t sources = 0;       // vertices that bleed now
  std::uint32_t open_vessels = 0;  // cut open and neither clipped nor pressed shut

  bool operator==(const BloodFigures&) const = default;
};

// The level says what the server's rate controller does. The numbers are those of proto::RateLevel.
enum class RateLevel : std::uint8_t {
  Fixed,       // decisions are fixed: there is no controller
  Full,        // all that was asked for
  Reduced,     // less, within its limits
  Overloaded,  // the least, and still too much: simulated time slows
};
inline constexpr std::size_t kRateLevels = 4;
const char* name_of(RateLevel level);

struct RateFigures {
  RateLevel level = RateLevel::Fixed;
  float budget_us = 0;                    // of a tick's time for its work; 0: none is kept
  float predicted_us = 0;                 // what the next tick will take
  std::uint64_t lowered = 0, raised = 0;  // steps in the whole session
  float time_rate = 1;                    // simulated time over real time, last second
  std::uint32_t waiting_tools = 0;        // bits of tools that were held back, last second

  bool operator==(const RateFigures&) const = default;
};

// These are measured: they differ from run to run of the same session.
struct PaceFigures {
  std::array<float, kStageCount> stage_median_us{};  // last second, by Stage
  float tick_median_us = 0, tick_p99_us = 0;         // last second
  std::uint64_t slow_ticks = 0;  // ticks by which simulated time fell behind real time
  RateFigures rate;

  bool operator==(const PaceFigures&) const = default;
};

// All of this comes with one published frame. None of it is ever an input of a tick.
struct FrameFigures {
  NearFigures near;
  SolveFigures solve;
  std::optional<RelaxationFigures> relaxation;  // of tissue that relaxes
  std::optional<BloodFigures> blood;            // of sessions that bleed
  std::uint64_t state_hash = 0;                 // after the frame's tick
  PaceFigures pace;

  bool operator==(const FrameFigures&) const = default;
};

}  // namespace trocar::wire
