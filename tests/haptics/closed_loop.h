#pragma once

// A hand on a device, a client, a lossy line to the server and back, and tissue at the server. A
// second tissue gets the device's motion without delay: its force is the truth. Errors are of the
// rendered force against it.

#include <functional>
#include <memory>
#include <string>

#include "tests/haptics/clients.h"
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
  double cut_n = 0;        // tissue gives way at this force
  double known_cut_n = 0;  // the client knows of it
  double bump_m = 0;       // waves of the surface
};

struct Line {
  double rtt_s = 0.05;
  double loss = 0.01;
  double jitter_s = -1;  // below 0: 2 % of the way and 0.2 ms
  double patch_hz = 62.5, reading_hz = 250;
};

struct Hand {
  double mass_kg = 0.15, stiffness_n_m = 400, damping_n_s_m = 4.5;
  double reflex_n_m = 80, reflex_s = 0.06;
  Vec3d place_m{0, 0, 0.006}, speed_m_s;
};

struct Outcome {
  double rms = 0;                      // error over the peak of the truth
  double greatest = 0;                 // likewise
  double step_n = 0, true_step_n = 0;  // greatest change in a millisecond
  double gain = 1, phase_deg = 0;
  double steady = 0;                       // error over the truth
  double work_mj = 0;                      // the most done on the hand since the start
  double cycle_mj = 0, true_cycle_mj = 0;  // done on the hand in a cycle
  double wobble_m = 0;
  double free_n = 0;       // greatest force 2 mm and more above the surface
  double recovery_s = -1;  // from a cut until the force is right within 15 %
  double peak_n = 0;
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
