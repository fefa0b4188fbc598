#pragma once

// Pieces of scenario texts. Lengths in mm, forces in N, as in the file.

#include <string>
#include <utility>
#include <vector>

#include "common/math/vec3.h"

namespace trocar::validation {

std::string lattice_organ(int nx, int ny, int nz, double spacing_mm);
std::string organ_source(const std::string& source);
std::string box_set(const std::string& name, const Vec3d& low_mm, const Vec3d& high_mm);
// All nodes within the radius, or only those of the surface; radius 0: the nearest one.
std::string near_set(const std::string& name, const Vec3d& point_mm, double radius_mm,
                     bool is_on_surface = false);

using TimedValue = std::pair<double, Vec3d>;  // s, value
std::string displace(const std::string& set, const std::vector<TimedValue>& keys_mm);
std::string force(const std::string& set, const std::vector<TimedValue>& keys_n);

struct ToolKey {
  double time_s;
  Vec3d position_mm;
  const char* verb;
};
// A tool whose shaft points along `shaft` away from the tip; moves linearly.
std::string tool(double radius_mm, double reach_mm, const Vec3d& shaft,
                 const std::vector<ToolKey>& keys);

}  // namespace trocar::validation
