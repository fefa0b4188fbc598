#pragma once

// Two things hold thread: jaws of tools, and what a scene holds an end by.
//
// Jaws that close take the nodes around the one nearest to their tip, draw them in, and hold each
// by a spring. Pulled harder than their grip, thread slides through them; what follows it in is
// held in its place. A node is in one tool's jaws only.

#include <span>
#include <vector>

#include "common/tool/tool.h"
#include "server/tissue/thread/elasticity.h"

namespace trocar::thread {

inline constexpr double kGripN_m = 2e4;          // of a node
inline constexpr double kTakesM = 5e-3;          // jaws take thread this near to their tip, at most
inline constexpr double kJawsM = 2.5e-3;         // they hold it this near to it
inline constexpr std::uint8_t kDrawTicks = 100;  // in which they close

// A tool is so in a tick.
struct ToolNow {
  ToolSlot tool;
  tool::ToolShape shape;
  tool::Verb verb = tool::Verb::None;
  Pose pose;             // world_from_tool
  Vec3d edge_m[2];       // ends of the edge, of what cuts
  bool can_cut = false;  // blades are open
};

class Grips {
 public:
  explicit Grips(const Rules& rules);

  // Once a tick: jaws take, draw in and let go.
  void close_and_open(std::span<const ToolNow> tools, Threads& threads);
  // part: of the tick, at the end of the step. Held nodes go where they are held. time_s: there.
  void begin(std::span<const ToolNow> tools, double part, double time_s, Threads& threads);
  void add(const Threads& threads, ChainSolver& solver) const;
  // Thread slides where it was pulled too hard.
  void end(Threads& threads);

  struct Pull {
    ToolSlot tool;
    Vec3d force_n, at_m;  // on the tool
  };
  std::span<const Pull> pulls() const { return pulls_; }
  // Force of a thread on what holds its ends, N; zero where an end is free.
  struct EndForces {
    Vec3d start_n, end_n;
  };
  std::span<const EndForces> end_forces() const { return end_forces_; }

 private:
  struct Spring {
    std::uint32_t node;
    Vec3d target_m;
    double most_n;
  };
  // An end of a thread of the rules.
  struct SceneEnd {
    std::uint32_t node;
    Vec3d at_m;
    End rule;
  };
  void take(const ToolNow& tool, Threads& threads) const;
  void take_what_slides_in(const ToolNow& tool, Threads& threads) const;
  void draw_in(const ToolNow& tool, Threads& threads) const;
  bool is_held(std::uint32_t node, const Threads& threads) const;
  static Vec3d force_n(const Spring& spring, const Threads& threads);

  double time_s_ = 0;
  std::vector<SceneEnd> ends_;   // two per thread
  std::vector<Spring> springs_;  // of the tools' holds, in their order, then of held ends
  std::vector<Pose> poses_;      // per hold
  std::vector<Pull> pulls_;
  std::vector<EndForces> end_forces_;
};

}  // namespace trocar::thread
