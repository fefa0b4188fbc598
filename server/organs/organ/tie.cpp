#include "server/organs/organ/tie.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "server/organs/organ/bad_file.h"

namespace trocar::organ {
namespace {

constexpr double kWeightTolerance = 1e-6;
constexpr std::size_t kMostBandNameBytes = 200;

Status check_number(const char* name, double value, double low, double high) {
  if (value >= low && value <= high) return {};
  char text[160];
  std::snprintf(text, sizeof text, "%s is %g, must be from %g to %g", name, value, low, high);
  return bad(text);
}

bool is_sound(const TieEnd& end, const mesh::TetMesh& mesh) {
  double sum = 0;
  for (const double weight : end.weights) {
    if (!(weight >= 0)) return false;
    sum += weight;
  }
  return end.triangle.value < mesh.boundary_triangles.size() &&
         std::abs(sum - 1) <= kWeightTolerance;
}

bool have_common_node(const Tie& tie, const mesh::TetMesh& mesh) {
  const auto& a = mesh.boundary_triangles[tie.ends[0].triangle.value];
  const auto& b = mesh.boundary_triangles[tie.ends[1].triangle.value];
  return std::ranges::find_first_of(a, b) != a.end();
}

}  // namespace

std::size_t tie_count(const std::vector<TieBand>& bands) {
  std::size_t count = 0;
  for (const auto& band : bands) count += band.ties.size();
  return count;
}

Vec3d place_of(const TieEnd& end, const mesh::TetMesh& mesh, const std::vector<Vec3d>& positions) {
  Vec3d place;
  for (std::size_t i = 0; i < 3; ++i)
    place += positions[mesh.boundary_triangles[end.triangle.value][i].value] * end.weights[i];
  return place;
}

Status validate(const TieLaw& law) {
  if (auto s = check_number("strength (Pa)", law.strength_pa, 1, 1e7); !s) return s;
  if (auto s = check_number("toughness (J/m^2)", law.toughness_j_m2, 1e-3, 1e5); !s) return s;
  if (auto s = check_number("rise (m)", law.rise_m, 1e-6, 0.1); !s) return s;
  if (law.rise_m < law.full_m()) return {};
  char text[200];
  std::snprintf(text, sizeof text,
                "rise is %g m, must be less than 2 toughness/strength, which is %g m: lower rise "
                "or strength",
                law.rise_m, law.full_m());
  return bad(text);
}

Status validate(const std::vector<TieBand>& bands, const mesh::TetMesh& mesh) {
  if (bands.size() > kMaxTieBands)
    return bad("has more than " + std::to_string(kMaxTieBands) + " bands of ties");
  if (tie_count(bands) > kMaxTies)
    return bad("has more than " + std::to_string(kMaxTies) + " ties: take more mm2 for each");
  for (const auto& band : bands) {
    if (band.name.empty() || band.name.size() > kMostBandNameBytes || band.ties.empty())
      return bad("ties need a name of 1 to 200 bytes, and at least one tie");
    const std::string ties = "ties '" + band.name + "': ";
    if (auto s = validate(band.law); !s) return bad(ties + s.error().message);
    for (std::size_t i = 0; i < band.ties.size(); ++i) {
      const auto& tie = band.ties[i];
      const std::string one = ties + "tie " + std::to_string(i);
      if (!is_sound(tie.ends[0], mesh) || !is_sound(tie.ends[1], mesh))
        return bad(one + " does not begin and end within a triangle of the surface");
      if (have_common_node(tie, mesh)) return bad(one + " ties a triangle to itself or the next");
      if (!(tie.area_m2 >= 1e-10 && tie.area_m2 <= 1e-2))
        return bad(one + " stands for an area that is not from 0.0001 to 10000 mm^2");
    }
  }
  return {};
}

}  // namespace trocar::organ
