#pragma once

// A hand on a device, a client, a lossy line to the server and back, and tissue at the server. A
// second tissue gets the device's motion without delay: its force is the truth. Errors are of the
// rendered force against it.

#include <functional>
#include <memory>
#include <string>

#include "tests/haptics/clients.h"
#include "tests/haptics/line.h"
#include "tests/haptics/record.h"
#include "tests/haptics/surrogate_tissue.h"

namespace trocar::haptics::testing {

// A motion that the hand wants, and what happens meanwhile. Surface coordinates: z out of the
// tissue.
struct Motion {
  std::string name;
  double seconds = 4;
  std::function<Vec3d(double s)> wanted_m;
  std::function<void(double s, SurrogateTissue&)> happens = nullptr;  // to both tissues
  double grasp_s = -1, release_s = -1;
  double frequency_hz = 0;  // of a palpation, measured from 1.5 s before the end
  double steady_from_s = -1;
  double cut_n = 0;   // tissue gives way at this force
  double bump_m = 0;  // waves of the surface
};

// Says what is to be measured of it.
Measured measured_of(const Motion& motion);

struct Hand {
  double mass_kg = 0.15, stiffness_n_m = 400, damping_n_s_m = 4.5;
  double reflex_n_m = 80, reflex_s = 0.06;
  Vec3d place_m{0, 0, 0.006}, speed_m_s;
};

using MakeClient = std::function<std::unique_ptr<Client>()>;

// The loop's tilt in the world.
struct Frame {
  Vec3d x, y, z, origin;

  static Frame tilted();
  Vec3d to_world(const Vec3d& v) const { return x * v.x + y * v.y + z * v.z; }
  Vec3d to_surface(const Vec3d& v) const { return {dot(x, v), dot(y, v), dot(z, v)}; }
};

Outcome run(const Motion& motion, TissueFigures tissue, const MakeClient& make_client,
            const Line& line = {}, const Hand& hand = {}, std::uint64_t seed = 3);

}  // namespace trocar::haptics::testing
