#include "client/shape/thread_mesh.h"

#include <array>

#include "client/shape/revolved.h"
#include "common/math/frame.h"

namespace trocar::shape {
namespace {

constexpr std::size_t kThreadSides = 6;
// A little thicker than what keeps threads apart, so that a knot looks closed.
constexpr float kThreadRadius = 0.7f * wire::kThreadMetres;
constexpr Material kPegMaterial = {214, 206, 190, 20};
// Silk is black, nylon dark blue, polyglactin violet, polypropylene blue; all of them lighter than
// they are, for they lie in the shadow of tissue.
constexpr std::array<Material, wire::kThreadMaterials> kThreadColours = {
    {{58, 60, 70, 60}, {52, 78, 148, 90}, {146, 84, 182, 40}, {56, 126, 226, 90}}};

using Ring = std::array<MeshVertex, kThreadSides>;

// `side` is carried along the thread, so that the tube does not twist.
Ring ring_at(const Vec3f& place, const Vec3f& along, Vec3f& side, const Material& material) {
  side = normalized(side - along * dot(side, along), cross(along, Vec3f{0.36f, 0.48f, 0.8f}));
  const Vec3f up = cross(along, side);
  Ring ring;
  for (std::size_t i = 0; i < kThreadSides; ++i) {
    const float angle = 2 * kPi * static_cast<float>(i) / kThreadSides;
    const Vec3f normal = side * std::cos(angle) + up * std::sin(angle);
    ring[i] = {place + normal * kThreadRadius, normal, material};
  }
  return ring;
}

void add_cap(const Ring& ring, const Vec3f& outward, bool is_end, MeshVertices& out) {
  for (std::size_t i = 1; i + 1 < kThreadSides; ++i) {
    MeshVertex a = ring[0], b = ring[is_end ? i : i + 1], c = ring[is_end ? i + 1 : i];
    a.normal = b.normal = c.normal = outward;
    out.insert(out.end(), {a, b, c});
  }
}

// The places are of nodes that are joined, two or more.
void add_tube(std::span<const Vec3f> places, const Material& material, MeshVertices& out) {
  const auto along = [&](std::size_t i) {
    const Vec3f& from = places[i == 0 ? 0 : i - 1];
    return normalized(places[std::min(i + 1, places.size() - 1)] - from, Vec3f{0, 0, 1});
  };
  Vec3f side{0.6f, 0, 0.8f};
  Ring before = ring_at(places[0], along(0), side, material);
  add_cap(before, -along(0), false, out);
  for (std::size_t i = 1; i < places.size(); ++i) {
    const Ring ring = ring_at(places[i], along(i), side, material);
    for (std::size_t k = 0; k < kThreadSides; ++k) {
      const std::size_t next = (k + 1) % kThreadSides;
      out.insert(out.end(), {before[k], before[next], ring[next], before[k], ring[next], ring[k]});
    }
    before = ring;
  }
  add_cap(before, along(places.size() - 1), true, out);
}

void add_peg(const wire::ThreadPeg& peg, MeshVertices& out) {
  const Vec3f from = wire::to_metres(peg.from), way = wire::to_metres(peg.to) - from;
  const float radius = static_cast<float>(peg.radius) * wire::kQuantumMetres;
  const Quatf turn = rotation_from_z(normalized(way, Vec3f{0, 0, 1}));
  std::vector<ProfilePoint> profile;
  constexpr int kRings = 5;
  for (const bool is_far : {false, true})
    for (int i = 0; i <= kRings; ++i) {
      const float angle = 0.5f * kPi * (static_cast<float>(i) / kRings - (is_far ? 0.0f : 1.0f));
      profile.push_back({(is_far ? length(way) : 0.0f) + radius * std::sin(angle),
                         radius * std::cos(angle), kPegMaterial, true});
    }
  MeshVertices made;
  revolve(profile, 20, 0, 2 * kPi, made);
  for (auto& vertex : made)
    out.push_back(
        {from + rotate(turn, vertex.position), rotate(turn, vertex.normal), vertex.material});
}

}  // namespace

void add_threads(const wire::ThreadPicture& picture, std::span<const Vec3f> places,
                 MeshVertices& out) {
  if (places.size() != picture.places.size()) return;
  std::size_t first = 0;
  for (const auto& thread : picture.threads) {
    const std::size_t end = first + thread.nodes;
    while (first < end) {
      std::size_t last = first;
      while (picture.is_joined[last] != 0) ++last;
      if (last > first)
        add_tube(places.subspan(first, last - first + 1), kThreadColours[thread.material], out);
      first = last + 1;
    }
  }
  for (const auto& peg : picture.pegs) add_peg(peg, out);
}

}  // namespace trocar::shape
