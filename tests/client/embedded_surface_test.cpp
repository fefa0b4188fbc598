// A fine surface on the coarse one: exact at rest, rigid where that is, and parted by a real
// operation with eight cuts as by nothing else.
//
// The fine surface is that of the same liver in smaller tets, so that no edge lies on another.

#include "client/embedding/embedded_surface.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <random>
#include <set>
#include <utility>

#include "common/math/frame.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/step/simulation.h"
#include "tests/client/cut_liver.h"

namespace trocar::embedding {
namespace {

constexpr float kExact_m = 1e-6f;   // of the request
constexpr double kLostArea = 1e-3;  // likewise: 0.1 %
constexpr int kFineTets = 100'000;

FineShape fine_liver() {
  const auto organ = catalogue::make_liver(kFineTets);
  const auto& mesh = organ->mesh;
  FineShape shape;
  std::vector<std::uint32_t> slot(mesh.node_count(), kNoFace);
  for (const auto& triangle : mesh.boundary_triangles) {
    auto& corners = shape.triangles.emplace_back();
    for (std::size_t k = 0; k < 3; ++k) {
      std::uint32_t& v = slot[triangle[k].value];
      if (v == kNoFace) {
        v = static_cast<std::uint32_t>(shape.positions.size());
        shape.positions.push_back(to_float(mesh.rest_positions[triangle[k].value]));
      }
      corners[k] = v;
    }
  }
  return shape;
}

struct Coarse {
  std::vector<Vec3f> rest, positions;
  std::vector<TriangleCorners> triangles;
  std::vector<std::uint8_t> is_wound;

  CoarseShape shape() const { return {rest, triangles, is_wound}; }
};

Coarse coarse_of(const wire::SurfaceLayout& layout) {
  Coarse coarse;
  for (const auto& q : layout.rest_quanta) coarse.rest.push_back(wire::to_metres(q));
  for (std::size_t i = 0; i < layout.triangles.size(); ++i) {
    const auto& t = layout.triangles[i];
    coarse.triangles.push_back(layout.has_triangle(TriangleIndex(i))
                                   ? TriangleCorners{t[0].value, t[1].value, t[2].value}
                                   : TriangleCorners{});
  }
  coarse.is_wound = layout.is_wound;
  coarse.positions = coarse.rest;
  return coarse;
}

Coarse liver_at_rest() {
  return coarse_of(step::Simulation(*catalogue::make_liver()).layout());
}

// Calls `visit` with the coarse surface at rest, and after each change of it by
// deploy/scenes/eight-cuts.toml.
template <typename Visit>
void operate(const Visit& visit) {
  visit(liver_at_rest());
  std::uint32_t epoch = 0;
  testing::operate_on_liver(
      [&](const wire::SurfaceLayout& layout, const step::PublishedFrame& frame) {
        if (layout.epoch == epoch) return;
        epoch = layout.epoch;
        Coarse coarse = coarse_of(layout);
        for (std::size_t v = 0; v < coarse.rest.size() && v < frame.surface.size(); ++v)
          coarse.positions[v] += wire::to_metres(frame.surface[v]);
        visit(coarse);
      });
}

double area_of(const Vec3f& a, const Vec3f& b, const Vec3f& c) {
  return 0.5 * double{length(cross(b - a, c - a))};
}

double area_of(const FineShape& shape) {
  double sum = 0;
  for (const auto& [a, b, c] : shape.triangles)
    sum += area_of(shape.positions[a], shape.positions[b], shape.positions[c]);
  return sum;
}

double area_of(const EmbeddedSurface& surface) {
  double sum = 0;
  const auto triangles = surface.triangles();
  for (const auto& [a, b, c] : triangles.first(triangles.size() - surface.skirt_count()))
    sum += area_of(surface.positions()[a], surface.positions()[b], surface.positions()[c]);
  return sum;
}

// Tells which coarse vertices a vertex is joined to, within three triangles of the outside. Across
// a wound the outside does not go on, but around its end.
class Neighbours {
 public:
  explicit Neighbours(const Coarse& coarse) : around_(coarse.rest.size()) {
    for (std::size_t i = 0; i < coarse.triangles.size(); ++i) {
      const auto& t = coarse.triangles[i];
      if (t[0] == t[1] || coarse.is_wound[i] != 0) continue;
      for (const std::uint32_t v : t)
        for (const std::uint32_t w : t) around_[v].insert(w);
    }
  }
  bool are_near(std::uint32_t from, std::uint32_t to) const {
    std::set<std::uint32_t> reached{from};
    for (int step = 0; step < 3; ++step) {
      auto next = reached;
      for (const std::uint32_t v : reached) next.insert(around_[v].begin(), around_[v].end());
      reached = std::move(next);
    }
    return reached.contains(to);
  }

 private:
  std::vector<std::set<std::uint32_t>> around_;
};

std::size_t triangles_across(const EmbeddedSurface& surface, const Coarse& coarse) {
  const Neighbours neighbours(coarse);
  std::size_t across = 0;
  for (const auto& triangle : surface.triangles()) {
    std::set<std::uint32_t> carriers;
    for (const std::uint32_t v : triangle)
      for (const std::uint32_t c : surface.carriers(v))
        if (c != kNoFace) carriers.insert(c);
    for (const std::uint32_t c : carriers)
      if (!neighbours.are_near(*carriers.begin(), c)) {
        ++across;
        break;
      }
  }
  return across;
}

float farthest(std::span<const Vec3f> a, std::span<const Vec3f> b) {
  float most = 0;
  for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, length(a[i] - b[i]));
  return most;
}

TEST(EmbeddedSurface, IsExactAtRest) {
  const FineShape fine = fine_liver();
  EmbeddedSurface surface(fine);
  const Coarse coarse = liver_at_rest();
  surface.follow(coarse.shape());
  surface.update(coarse.rest);
  ASSERT_EQ(surface.vertex_count(), fine.positions.size());
  EXPECT_LT(farthest(surface.positions(), fine.positions), kExact_m);
  EXPECT_EQ(surface.parted_count(), 0u);
  EXPECT_EQ(surface.triangles().size(), fine.triangles.size());
}

// Returns the coarse surface with each triangle made four: its vertices lie on coarse edges, where
// two faces are as near.
FineShape divided(const Coarse& coarse) {
  FineShape shape{coarse.rest, {}, {}};
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
  const auto middle = [&](std::uint32_t a, std::uint32_t b) {
    const auto [at, is_new] =
        middles.try_emplace(std::minmax(a, b), static_cast<std::uint32_t>(shape.positions.size()));
    if (is_new) shape.positions.push_back((coarse.rest[a] + coarse.rest[b]) * 0.5f);
    return at->second;
  };
  for (const auto& [a, b, c] : coarse.triangles) {
    if (a == b) continue;
    const std::uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
    for (const TriangleCorners& t : {TriangleCorners{a, ab, ca}, TriangleCorners{ab, b, bc},
                                     TriangleCorners{ca, bc, c}, TriangleCorners{ab, bc, ca}})
      shape.triangles.push_back(t);
  }
  return shape;
}

// Returns the places of all triangles, in order: how a surface came to be what it is decides how
// its vertices are numbered.
std::vector<std::array<float, 9>> places_of(const EmbeddedSurface& surface) {
  std::vector<std::array<float, 9>> places;
  for (const TriangleCorners& triangle : surface.triangles()) {
    auto& place = places.emplace_back();
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3f& p = surface.positions()[triangle[k]];
      place[3 * k] = p.x, place[3 * k + 1] = p.y, place[3 * k + 2] = p.z;
    }
  }
  std::sort(places.begin(), places.end());
  return places;
}

TEST(EmbeddedSurface, WhoJoinsLateSeesTheSame) {
  for (const FineShape& fine : {fine_liver(), divided(liver_at_rest())}) {
    EmbeddedSurface surface(fine);
    int changes = 0;
    operate([&](const Coarse& coarse) {
      surface.follow(coarse.shape());
      if (++changes % 16 != 0) return;
      surface.update(coarse.positions);
      EmbeddedSurface late(fine);
      late.follow(coarse.shape());
      late.update(coarse.positions);
      EXPECT_EQ(late.parted_count(), surface.parted_count());
      EXPECT_TRUE(places_of(late) == places_of(surface)) << "after change " << changes;
    });
    EXPECT_GT(surface.parted_count(), 100u);
  }
}

TEST(EmbeddedSurface, PartsAlongCutsAndNowhereElse) {
  const FineShape fine = fine_liver();
  const double area = area_of(fine);
  EmbeddedSurface surface(fine);
  Coarse last;
  int changes = 0;
  operate([&](const Coarse& coarse) {
    surface.follow(coarse.shape());
    if (++changes % 16 == 0) {
      surface.update(coarse.rest);
      EXPECT_NEAR(area_of(surface) / area, 1, kLostArea) << "after change " << changes;
    }
    last = coarse;
  });
  ASSERT_GT(changes, 50);
  EXPECT_GT(surface.parted_count(), 100u);
  EXPECT_LT(surface.parted_count(), fine.triangles.size() / 4);

  surface.update(last.rest);
  EXPECT_NEAR(area_of(surface) / area, 1, kLostArea);
  for (std::size_t v = 0; v < surface.vertex_count(); ++v)
    ASSERT_LT(length(surface.positions()[v] - surface.looks()[v].rest), kExact_m);
  EXPECT_EQ(triangles_across(surface, last), 0u);

  // A rigid motion of what was cut.
  const Pose motion{{0.03f, -0.02f, 0.05f}, normalized(Quatf{0.3f, -0.5f, 0.2f, 0.8f})};
  std::vector<Vec3f> moved;
  for (const Vec3f& p : last.rest) moved.push_back(motion.apply(p));
  surface.update(moved);
  float most = 0;
  for (std::size_t v = 0; v < surface.vertex_count(); ++v)
    most = std::max(most, length(surface.positions()[v] - motion.apply(surface.looks()[v].rest)));
  EXPECT_LT(most, kExact_m);

  std::printf("%zu changes, %zu of %zu triangles in parts, %zu drawn, %zu of skirts\n",
              static_cast<std::size_t>(changes), surface.parted_count(), fine.triangles.size(),
              surface.triangles().size(), surface.skirt_count());
}

TEST(EmbeddedSurface, OneThatIsElsewhereDoesNoHarm) {
  FineShape fine = fine_liver();
  for (std::size_t v = 0; v < fine.positions.size(); v += 2) fine.positions[v] += {1.5f, 0, 0};
  EmbeddedSurface surface(fine);
  const Coarse coarse = liver_at_rest();
  surface.follow(coarse.shape());
  surface.update(coarse.rest);
  EXPECT_LT(farthest(surface.positions(), fine.positions), kExact_m);
  surface.follow({});
  surface.update({});
  // A triangle that lies on an edge does none, nor does one that is as large as the organ.
  const Vec3f a = coarse.rest[coarse.triangles[0][0]], b = coarse.rest[coarse.triangles[0][1]];
  EmbeddedSurface slender({{a, b, (a + b) * 0.5f, {0.1f, 0, 0}, {-0.1f, 0, 0}, {0, 0.1f, 0}},
                           {{0, 1, 2}, {3, 4, 5}},
                           {}});
  Coarse cut = coarse;
  cut.is_wound.assign(cut.triangles.size(), 0);
  for (std::size_t i = 0; i < cut.triangles.size(); i += 3) cut.is_wound[i] = 1;
  slender.follow(cut.shape());
  slender.update(cut.rest);
  for (const Vec3f& p : slender.positions()) EXPECT_TRUE(is_finite(p));
}

// Slivers whose boxes fill all of space have a short first edge, or three long ones: as many as a
// message may hold.
TEST(EmbeddedSurface, SliversAcrossAllOfSpaceTakeLittleMemory) {
  for (const bool is_first_edge_short : {true, false}) {
    FineShape shape;
    for (int i = 0; i < 1000; ++i) {
      const float along = 1e-6f * static_cast<float>(i);
      shape.positions.push_back({-1.9f + along, -1.9f, -1.9f});
      shape.positions.push_back(is_first_edge_short ? Vec3f{-1.9f, -1.9f + along + 1e-6f, -1.9f}
                                                    : Vec3f{1.9f, -1.9f + along, 1.9f});
      shape.positions.push_back({1.9f, 1.9f - along, 1.9f});
    }
    for (std::uint32_t i = 0; i < 200'000; ++i) {
      const std::uint32_t first = 3 * (i % 1000), last = 3 * ((i + i / 1000) % 1000) + 2;
      shape.triangles.push_back({first, first + 1, last});
    }
    FaceGrid grid;
    grid.build(shape.positions, shape.triangles, 1e-6f);
    EXPECT_LE(grid.entry_count(), 32 * shape.triangles.size() + 49 * 49 * 49);
    EmbeddedSurface surface(std::move(shape));
    const Coarse coarse = liver_at_rest();
    surface.follow(coarse.shape());
    surface.update(coarse.rest);
    for (const Vec3f& p : surface.positions()) ASSERT_TRUE(is_finite(p));
  }
}

TEST(EmbeddedSurface, SeamOfAPictureIsNoCrease) {
  FineShape fine = fine_liver();
  const FineShape whole = fine;
  // Every second triangle has vertices of its own, as if the picture began anew there.
  fine.texture.assign(fine.positions.size(), {0, 0});
  for (std::size_t t = 0; t < fine.triangles.size(); t += 2)
    for (std::uint32_t& v : fine.triangles[t]) {
      const Vec3f place = fine.positions[v];
      v = static_cast<std::uint32_t>(fine.positions.size());
      fine.positions.push_back(place);
      fine.texture.push_back({1, 1});
    }
  EmbeddedSurface seamed(fine), smooth(whole);
  const Coarse coarse = liver_at_rest();
  for (EmbeddedSurface* surface : {&seamed, &smooth}) {
    surface->follow(coarse.shape());
    surface->update(coarse.rest);
  }
  std::vector<std::uint32_t> first(whole.positions.size(), kNoFace);  // of the copies of a vertex
  for (std::size_t t = 0; t < whole.triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t v = fine.triangles[t][k], w = whole.triangles[t][k];
      if (first[w] == kNoFace) first[w] = v;
      ASSERT_LT(length(seamed.normals()[v] - smooth.normals()[w]), 1e-4f);
      ASSERT_EQ(seamed.carriers(v), seamed.carriers(first[w]));
    }
}

TEST(FaceGrid, FindsNoFaceOfAnotherLobe) {
  const std::vector<Vec3f> places{{0, 0, 0},    {1, 0, 0},    {0, 1, 0},
                                  {0, 0, 0.5f}, {1, 0, 0.5f}, {0, 1, 0.5f}};
  const std::vector<TriangleCorners> faces{{0, 1, 2}, {3, 4, 5}};
  FaceGrid grid;
  grid.build(places, faces, 2);
  Box<float> box;
  box.include({0.2f, 0.2f, 0});
  box.grow(0.1f);
  std::vector<std::uint32_t> found;
  grid.find(box, found);
  EXPECT_EQ(found, std::vector<std::uint32_t>{0});
}

// Small faces that do not join, each of whose edges is a rim, under triangles that cover all of
// them.
TEST(EmbeddedSurface, PartsAreBoundedWhateverTheCoarseSurface) {
  constexpr std::uint32_t kSide = 14, kCopies = 1500;
  Coarse coarse;
  for (std::uint32_t i = 0; i < kSide * kSide; ++i) {
    const Vec3f corner{1e-3f * static_cast<float>(i % kSide), 1e-3f * static_cast<float>(i / kSide),
                       0};
    coarse.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    for (const Vec3f& to : {Vec3f{}, Vec3f{0.9e-3f, 0, 0}, Vec3f{0, 0.9e-3f, 0}})
      coarse.rest.push_back(corner + to);
  }
  FineShape shape;
  for (std::uint32_t i = 0; i < kCopies; ++i) {
    const float high = 1e-6f * static_cast<float>(i);
    for (const Vec3f& p : {Vec3f{}, Vec3f{0.0135f, 0, 0}, Vec3f{0, 0.0135f, 0}})
      shape.positions.push_back({p.x, p.y, high});
    shape.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  EmbeddedSurface surface(shape);
  surface.follow(coarse.shape());
  EXPECT_GT(surface.vertex_count(), kMostPartVertices);
  // The last one that is parted may pass the limit: 256 faces, of at most 24 points and as many
  // skirts of four vertices at each of three edges.
  EXPECT_LT(surface.vertex_count(), shape.positions.size() + kMostPartVertices + 256 * 24 * 13);
  EXPECT_LT(surface.parted_count(), kCopies);
}

TEST(EmbeddedSurface, MovesOnlyWhatMoves) {
  EmbeddedSurface surface(fine_liver());
  const Coarse coarse = liver_at_rest();
  surface.follow(coarse.shape());
  surface.update(coarse.rest);
  EXPECT_EQ(surface.moved_count(), surface.vertex_count());
  surface.update(coarse.rest);
  EXPECT_EQ(surface.moved_count(), 0u);
  auto moved = coarse.rest;
  moved[7].y += 1e-3f;
  surface.update(moved);
  EXPECT_GT(surface.moved_count(), 0u);
  EXPECT_LT(surface.moved_count(), surface.vertex_count() / 20);
}

}  // namespace
}  // namespace trocar::embedding
