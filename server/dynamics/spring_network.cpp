#include "server/dynamics/spring_network.h"

#include <algorithm>
#include <cmath>

namespace trocar::dynamics {

SpringNetwork::SpringNetwork(const scene::Organ& organ)
    : node_damping_per_s_(static_cast<float>(organ.material.node_damping_per_s)) {
  const auto& pairs = organ.mesh.spring_pairs();
  const auto stiffnesses = scene::spring_stiffnesses(organ);
  const auto node_count = organ.mesh.node_count();
  offsets_.assign(node_count + 1, 0);
  for (const auto& pair : pairs)
    for (const auto node : pair) ++offsets_[node.value + 1];
  for (std::size_t i = 0; i < node_count; ++i) offsets_[i + 1] += offsets_[i];
  half_springs_.resize(offsets_.back());
  std::vector<std::uint32_t> cursor(offsets_.begin(), offsets_.end() - 1);
  for (std::size_t s = 0; s < pairs.size(); ++s) {
    const auto [a, b] = pairs[s];
    const Vec3d r = organ.mesh.rest_positions[b.value] - organ.mesh.rest_positions[a.value];
    const double k = stiffnesses[s];
    HalfSpring spring{.neighbour = b,
                      .rest_vector = to_float(r),
                      .rest_length = static_cast<float>(length(r)),
                      .stiffness = static_cast<float>(k),
                      .damping = static_cast<float>(k * organ.material.spring_damping_time_s)};
    half_springs_[cursor[a.value]++] = spring;
    spring.neighbour = a;
    spring.rest_vector = -spring.rest_vector;
    half_springs_[cursor[b.value]++] = spring;
  }
}

void SpringNetwork::add_gradient_and_block(NodeIndex node, std::span<const Vec3f> x,
                                           std::span<const Vec3f> start, float inverse_dt,
                                           Vec3f& gradient, SymMat3f& block) const {
  const Vec3f xi = x[node.value];
  const Vec3f si = start[node.value];
  for (const auto& s : springs(node)) {
    const Vec3f moved = x[s.neighbour.value] - xi;
    const Vec3f r = s.rest_vector + moved;
    const float l = std::sqrt(length_squared(r));
    if (!(l > 1e-9f)) continue;  // both ends coincide: no direction, no force
    const float inverse_l = 1.0f / l;
    const Vec3f e = r * inverse_l;
    gradient -= e * (s.stiffness * (l - s.rest_length));
    // k [e e^T + max(0, 1 - l0/l) (I - e e^T)]
    const float across = s.stiffness * std::max(0.0f, 1.0f - s.rest_length * inverse_l);
    block.add_identity(across);
    block.add_outer(e, s.stiffness - across);

    const float c = s.damping * inverse_dt;
    const Vec3f moved_start = start[s.neighbour.value] - si;
    const Vec3f r_start = s.rest_vector + moved_start;
    const float l_start = std::sqrt(length_squared(r_start));
    if (!(l_start > 1e-9f)) continue;
    const Vec3f e_start = r_start * (1.0f / l_start);
    gradient -= e_start * (c * dot(e_start, moved - moved_start));
    block.add_outer(e_start, c);
  }
}

double SpringNetwork::elastic_energy(std::span<const Vec3f> displacements) const {
  double twice = 0;  // every spring is stored at both ends
  for (std::uint32_t i = 0; i + 1 < offsets_.size(); ++i)
    for (const auto& s : springs(NodeIndex(i))) {
      const Vec3d r = to_double(s.rest_vector) + to_double(displacements[s.neighbour.value]) -
                      to_double(displacements[i]);
      const double stretch = length(r) - static_cast<double>(s.rest_length);
      twice += 0.5 * static_cast<double>(s.stiffness) * stretch * stretch;
    }
  return 0.5 * twice;
}

}  // namespace trocar::dynamics
