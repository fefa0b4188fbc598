#include "server/dynamics/spring_network.h"

#include <immintrin.h>

#include <cmath>

namespace trocar::dynamics {
namespace {

// Eight floats with the operators of one; each is one IEEE rounding, as in scalar code.
using Float8 = __m256;
static_assert(sizeof(Float8) == kSpringLanes * sizeof(float));

Float8 load(const float* p) {
  return _mm256_load_ps(p);
}
Float8 all(float value) {
  return _mm256_set1_ps(value);
}

float sum(Float8 v) {
  // ((0 + 4) + (2 + 6)) + ((1 + 5) + (3 + 7)): fixed, like everything that state depends on.
  const __m128 four = _mm_add_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps(v, 1));
  const __m128 two = _mm_add_ps(four, _mm_movehl_ps(four, four));
  return _mm_cvtss_f32(_mm_add_ss(two, _mm_shuffle_ps(two, two, 1)));
}

struct Vec8 {
  Float8 x, y, z;
};
Float8 dot8(const Vec8& a, const Vec8& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

// (x, y, z, 0) without touching what lies behind z.
__m128 load_vector(const Vec3f& v) {
  // Not _mm_load_sd: a Vec3f is aligned to four bytes, a double to eight.
  const __m128 xy = _mm_castsi128_ps(_mm_loadu_si64(&v.x));
  return _mm_movelh_ps(xy, _mm_load_ss(&v.z));
}

// Displacements of a batch's neighbours minus the node's own. Loads and transposes: the hardware's
// gather instruction was measured a tenth slower.
Vec8 moved(const std::uint32_t* neighbours, std::span<const Vec3f> x, const Vec3f& own) {
  const auto pair = [&](std::size_t lane) {
    return _mm256_insertf128_ps(_mm256_castps128_ps256(load_vector(x[neighbours[lane]])),
                                load_vector(x[neighbours[lane + 4]]), 1);
  };
  const Float8 v0 = pair(0), v1 = pair(1), v2 = pair(2), v3 = pair(3);
  const Float8 xy01 = _mm256_unpacklo_ps(v0, v1), xy23 = _mm256_unpacklo_ps(v2, v3);
  const Float8 z01 = _mm256_unpackhi_ps(v0, v1), z23 = _mm256_unpackhi_ps(v2, v3);
  return {_mm256_shuffle_ps(xy01, xy23, 0x44) - all(own.x),
          _mm256_shuffle_ps(xy01, xy23, 0xee) - all(own.y),
          _mm256_shuffle_ps(z01, z23, 0x44) - all(own.z)};
}

// Two nodes in one place have no direction between them: the spring is silent instead of infinite.
Float8 inverse_length(Float8 length) {
  const Float8 is_long = _mm256_cmp_ps(length, all(1e-9f), _CMP_GT_OQ);
  return _mm256_and_ps(all(1.0f) / length, is_long);
}

}  // namespace

SpringNetwork::SpringNetwork(const scene::Organ& organ)
    : node_damping_per_s_(static_cast<float>(organ.material.node_damping_per_s)) {
  const auto& pairs = organ.mesh.spring_pairs();
  const auto springs = scene::springs_of(organ);
  const auto node_count = organ.mesh.node_count();
  std::vector<std::vector<std::uint32_t>> springs_of(node_count);
  for (std::uint32_t s = 0; s < pairs.size(); ++s)
    for (const auto node : pairs[s]) springs_of[node.value].push_back(s);

  offsets_.push_back(0);
  for (std::uint32_t n = 0; n < node_count; ++n) {
    for (std::size_t i = 0; i < springs_of[n].size(); i += kSpringLanes) {
      Batch& batch = batches_.emplace_back();
      for (std::size_t lane = 0; lane < kSpringLanes; ++lane) {
        batch.neighbour[lane] = n;  // padding: a spring of no stiffness to the node itself
        batch.rx[lane] = batch.rest_length[lane] = 1;
        if (i + lane >= springs_of[n].size()) continue;
        const auto s = springs_of[n][i + lane];
        const auto other = pairs[s][0].value == n ? pairs[s][1] : pairs[s][0];
        const Vec3d r = organ.mesh.rest_positions[other.value] - organ.mesh.rest_positions[n];
        batch.neighbour[lane] = other.value;
        batch.rx[lane] = static_cast<float>(r.x);
        batch.ry[lane] = static_cast<float>(r.y);
        batch.rz[lane] = static_cast<float>(r.z);
        batch.rest_length[lane] = static_cast<float>(springs[s].rest_length_m);
        batch.stiffness[lane] = static_cast<float>(springs[s].stiffness_n_m);
        batch.damping[lane] = static_cast<float>(springs[s].damping_n_s_m);
      }
    }
    offsets_.push_back(static_cast<std::uint32_t>(batches_.size()));
  }
}

SymMat3f SpringNetwork::prepare_step(NodeIndex node, std::span<const Vec3f> start, float inverse_dt,
                                     std::span<StepTerms> terms) const {
  const Vec3f own = start[node.value];
  Float8 xx = all(0), xy = all(0), xz = all(0), yy = all(0), yz = all(0), zz = all(0);
  for (auto i = offsets_[node.value]; i < offsets_[node.value + 1]; ++i) {
    const Batch& b = batches_[i];
    const Vec8 m = moved(b.neighbour, start, own);
    const Vec8 r{load(b.rx) + m.x, load(b.ry) + m.y, load(b.rz) + m.z};
    const Float8 scale = _mm256_sqrt_ps(load(b.damping) * all(inverse_dt)) *
                         inverse_length(_mm256_sqrt_ps(dot8(r, r)));
    const Vec8 g{r.x * scale, r.y * scale, r.z * scale};
    StepTerms& t = terms[i];
    _mm256_store_ps(t.gx, g.x);
    _mm256_store_ps(t.gy, g.y);
    _mm256_store_ps(t.gz, g.z);
    _mm256_store_ps(t.offset, dot8(g, m));
    xx = xx + g.x * g.x;
    xy = xy + g.x * g.y;
    xz = xz + g.x * g.z;
    yy = yy + g.y * g.y;
    yz = yz + g.y * g.z;
    zz = zz + g.z * g.z;
  }
  return {sum(xx), sum(xy), sum(xz), sum(yy), sum(yz), sum(zz)};
}

void SpringNetwork::add_gradient_and_block(NodeIndex node, std::span<const Vec3f> x,
                                           std::span<const StepTerms> terms, Vec3f& gradient,
                                           SymMat3f& block) const {
  const Vec3f own = x[node.value];
  Float8 fx = all(0), fy = all(0), fz = all(0), identity = all(0);
  Float8 xx = all(0), xy = all(0), xz = all(0), yy = all(0), yz = all(0), zz = all(0);
  for (auto i = offsets_[node.value]; i < offsets_[node.value + 1]; ++i) {
    const Batch& b = batches_[i];
    const Vec8 m = moved(b.neighbour, x, own);
    const Vec8 r{load(b.rx) + m.x, load(b.ry) + m.y, load(b.rz) + m.z};
    const Float8 k = load(b.stiffness), l0 = load(b.rest_length);
    const Float8 l = _mm256_sqrt_ps(dot8(r, r));
    const Float8 inverse_l = inverse_length(l);
    const Vec8 e{r.x * inverse_l, r.y * inverse_l, r.z * inverse_l};
    const Float8 tension = k * (l - l0);

    const StepTerms& t = terms[i];
    const Vec8 g{load(t.gx), load(t.gy), load(t.gz)};
    const Float8 rate = dot8(g, m) - load(t.offset);
    fx = fx + (e.x * tension + g.x * rate);
    fy = fy + (e.y * tension + g.y * rate);
    fz = fz + (e.z * tension + g.z * rate);

    // k [e e^T + max(0, 1 - l0/l) (I - e e^T)]
    const Float8 across = k * _mm256_max_ps(all(0), all(1.0f) - l0 * inverse_l);
    const Float8 along = k - across;
    const Vec8 ae{e.x * along, e.y * along, e.z * along};
    identity = identity + across;
    xx = xx + e.x * ae.x;
    xy = xy + e.x * ae.y;
    xz = xz + e.x * ae.z;
    yy = yy + e.y * ae.y;
    yz = yz + e.y * ae.z;
    zz = zz + e.z * ae.z;
  }
  gradient -= {sum(fx), sum(fy), sum(fz)};
  block.add_identity(sum(identity));
  block += SymMat3f{sum(xx), sum(xy), sum(xz), sum(yy), sum(yz), sum(zz)};
}

double SpringNetwork::elastic_energy(std::span<const Vec3f> displacements) const {
  double twice = 0;  // every spring is stored at both ends
  for (std::uint32_t n = 0; n + 1 < offsets_.size(); ++n)
    for (auto i = offsets_[n]; i < offsets_[n + 1]; ++i)
      for (std::size_t lane = 0; lane < kSpringLanes; ++lane) {
        const Batch& b = batches_[i];
        const Vec3d rest = to_double(Vec3f{b.rx[lane], b.ry[lane], b.rz[lane]});
        const Vec3d r =
            rest + to_double(displacements[b.neighbour[lane]]) - to_double(displacements[n]);
        const double stretch = length(r) - static_cast<double>(b.rest_length[lane]);
        twice += 0.5 * static_cast<double>(b.stiffness[lane]) * stretch * stretch;
      }
  return 0.5 * twice;
}

}  // namespace trocar::dynamics
