#pragma once

// Bullet's deformable bodies (Debian's library, float) on a pulled box, in this process: the peer
// that solves the same problem from a package manager. Each step is one call of stepSimulation with
// nothing to collide with; the library's own limits (one Newton step, at most 300 Krylov
// iterations, its tolerance) stay as they are. Nodal damping and the load are one force of ours
// beside the library's elastic one, since two of its three laws know no nodal damping; this leaves
// the third without its own damping pass over the tets, in the library's favour. Not thread-safe.

#include <cstdint>
#include <memory>

#include "tests/bench/pulled_box.h"

namespace trocar::bench {

enum class BulletLaw {
  Linear,
  NeoHookean,         // its parameters converted so that E and nu at rest are the material's
  NeoHookeanAsGiven,  // mu and lambda passed as they are: a body about a quarter softer
  MassSpring,         // one stiffness for all links, the mean of volume-consistent ones
};

class BulletPeer {
 public:
  BulletPeer(const PulledBox& box, BulletLaw law, bool is_implicit, double dt_s);
  ~BulletPeer();

  void step();
  double face_displacement() const;  // m
  std::uint64_t state_hash() const;  // over node positions
  static const char* version();

 private:
  struct Body;
  std::unique_ptr<Body> body_;
};

}  // namespace trocar::bench
