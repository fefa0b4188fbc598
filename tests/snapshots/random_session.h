#pragma once

// A session of random hands on a random organ, whose state is written at random ticks, read into
// another simulation, and continued there: bytes and hashes must be the same. A seed names a run.

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/tissue/step/simulation.h"
#include "tests/support/random.h"

namespace trocar::testing {

enum class SnapshotOrgan { Liver, MeasuredLiver, Plate, Stomach, Chest, Lattice };
inline constexpr int kSnapshotOrgans = 6;
const char* name_of(SnapshotOrgan organ);

// These figures count what the written states have shown.
struct SnapshotFigures {
  std::uint64_t snapshots = 0, bytes = 0;
  std::uint64_t in_a_cut = 0;  // a blade's claim was in effect
  std::uint64_t cut = 0;       // topology had changed
  std::uint64_t after_a_tear = 0;
  std::uint64_t self_contact = 0;  // pairs of tissue in contact
  std::uint64_t grasp = 0, push = 0;
  std::uint64_t mark = 0;  // a mark was set
  std::uint64_t ticks_continued = 0;

  SnapshotFigures& operator+=(const SnapshotFigures& other);
};

struct SnapshotScene {
  organ::Organ organ;
  step::LoadRules loads = {};
  // Hands stay this near to a place, m; 0: they go everywhere.
  float reach_m = 0;
};
SnapshotScene random_scene(SnapshotOrgan organ, std::uint64_t seed);
// Returns a liver of which one part is drawn to and fro, another is held along some axes, and a
// third is pulled at.
SnapshotScene loaded_scene(std::uint64_t seed);

class RandomSession {
 public:
  RandomSession(SnapshotScene scene, std::uint64_t seed);
  ~RandomSession();

  // Goes on until so many more states were written and continued. Returns what was wrong, or
  // nothing.
  std::string run(std::uint64_t snapshots);
  const SnapshotFigures& figures() const { return figures_; }
  Tick tick() const { return simulation_.current_tick(); }

 private:
  enum class Work { Scalpel, Forceps, Finger };
  struct Key {
    Tick tick = 0;
    Pose pose;
    tool::Verb verb = tool::Verb::None;
  };
  struct Hand {
    Work work = Work::Finger;
    std::vector<Key> keys;  // the next motion; empty: none yet
    bool is_present = false;
  };
  struct Restored {
    std::unique_ptr<step::Simulation> simulation;
    Tick tick = 0, until = 0;
  };

  tool::ToolShape random_edge();
  void make_inputs();
  void plan(Hand& hand, Tick now);
  Pose pose_at(const Hand& hand, Tick now, tool::Verb& verb) const;
  NodeIndex any_surface_node();
  Vec3f out_of(NodeIndex node) const;
  std::string snapshot();
  void count_state();

  step::Simulation simulation_;
  const float reach_m_;
  NodeIndex home_;
  Random random_;
  std::vector<Hand> hands_;
  std::vector<Restored> restored_;
  step::TickDecisions decisions_;
  hands::TickInputs inputs_;
  Tick next_snapshot_ = 1;
  double torn_m2_ = 0;
  Bytes bytes_, again_;
  SnapshotFigures figures_;
};

}  // namespace trocar::testing
