#include "common/wire/surface_change.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <functional>
#include <string>

#include "common/wire/surface_messages.h"
#include "proto/wire.pb.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/tissue/world/surface_layout.h"
#include "tests/support/surface_edits.h"

namespace trocar::wire {
namespace {

using testing::is_closed;
using testing::open_slit;
using testing::path_between;
using testing::Random;
using testing::random_change;
using testing::split_edge;

SurfaceLayout box() {
  return world::make_surface_layout(*catalogue::make_lattice({8, 5, 8, 0.01}));
}
VertexIndex nearest(const SurfaceLayout& layout, const QuantisedVertex& at) {
  const auto distance = [&](const QuantisedVertex& v) {
    const auto d = v - at;
    return std::int64_t{d.x} * d.x + std::int64_t{d.y} * d.y + std::int64_t{d.z} * d.z;
  };
  return VertexIndex(static_cast<std::size_t>(
      std::ranges::min_element(layout.rest_quanta, {}, distance) - layout.rest_quanta.begin()));
}
// Opens a slit along the top of the box.
SurfaceChange slit(const SurfaceLayout& layout) {
  const auto path =
      path_between(layout, nearest(layout, {-800, 625, 0}), nearest(layout, {800, 625, 0}));
  return open_slit(layout, path, {0, -300, 0});
}
// Removes the indices of nodes, which a client does not have.
SurfaceLayout without_nodes(SurfaceLayout layout) {
  layout.vertex_of_node.clear();
  std::ranges::fill(layout.node_of_vertex, NodeIndex{});
  return layout;
}
SurfaceChange without_nodes(SurfaceChange change) {
  for (NewVertex& v : change.new_vertices) v.node = {};
  return change;
}
proto::SurfaceTopology message_of(const SurfaceLayout& layout) {
  proto::SurfaceTopology message;
  write(layout, "box", message);
  return message;
}

TEST(surface_change, gaps_and_names_of_regions_go_over_the_wire) {
  const SurfaceLayout before = box();
  SurfaceChange change = slit(before);
  change.added.insert(change.added.begin() + 1, NewTriangle{});
  change.regions = {"gall bladder", "vessel"};
  change.sum = sum_after(change, before);
  SurfaceLayout after = before;
  ASSERT_TRUE(apply(change, after).ok());
  proto::SurfaceChange message;
  write(change, after, message);
  const auto known = without_nodes(before);
  const auto read_back = read(message, known);
  ASSERT_TRUE(read_back.ok()) << read_back.error().message;
  EXPECT_EQ(*read_back, without_nodes(change));
  for (int i = 0; i <= kMaxChangeRegions; ++i) message.add_region("x");
  EXPECT_FALSE(read(message, known).ok());
}

TEST(surface_change, a_slit_keeps_the_surface_closed_and_numbers_in_place) {
  SurfaceLayout layout = box();
  ASSERT_TRUE(is_closed(layout));
  const SurfaceLayout before = layout;
  const SurfaceChange change = slit(layout);
  ASSERT_GE(change.new_vertices.size(), 6u);
  ASSERT_TRUE(apply(change, layout).ok());
  EXPECT_TRUE(is_closed(layout));
  EXPECT_EQ(layout.epoch, 1u);
  EXPECT_EQ(layout.vertex_count(), before.vertex_count() + change.new_vertices.size());
  EXPECT_EQ(layout.triangles.size(), before.triangles.size() + change.added.size());
  for (const TriangleIndex number : change.removed) EXPECT_FALSE(layout.has_triangle(number));
  for (std::size_t i = 0; i < before.triangles.size(); ++i) {
    if (!layout.has_triangle(TriangleIndex(i))) continue;
    EXPECT_EQ(layout.triangles[i], before.triangles[i]);
  }
  for (std::size_t i = 0; i < change.new_vertices.size(); ++i) {
    const VertexIndex slot(before.vertex_count() + i);
    EXPECT_EQ(layout.vertex_of_node[layout.node_of_vertex[slot.value].value], slot);
  }
  EXPECT_EQ(layout.triangle_sum, layout.compute_triangle_sum());
  EXPECT_NE(layout.triangle_sum, before.triangle_sum);
}

TEST(surface_change, the_hash_is_as_stated) {
  // Computed by hand from the formula in the header: a page in another language must get these.
  const Corners corners{VertexIndex(1), VertexIndex(2), VertexIndex(3)};
  const std::uint64_t outer = triangle_hash(TriangleIndex(7), corners, false);
  EXPECT_EQ(triangle_hash(TriangleIndex(7), corners, true), ~outer);
  EXPECT_NE(outer, triangle_hash(TriangleIndex(8), corners, false));
  EXPECT_NE(outer, triangle_hash(TriangleIndex(7), {corners[1], corners[2], corners[0]}, false));
  EXPECT_EQ(
      triangle_hash(TriangleIndex(0), {VertexIndex(0), VertexIndex(0), VertexIndex(0)}, false), 0u);
}

TEST(surface_change, between_rounds_to_the_nearest_on_either_side_of_zero) {
  EXPECT_EQ(between({0, 0, 0}, {3, -3, 100}, 0x8000), (QuantisedVertex{2, -1, 50}));
  EXPECT_EQ(between({10, -10, 7}, {10, -10, 7}, 12345), (QuantisedVertex{10, -10, 7}));
  EXPECT_EQ(between({-62500, 62500, 0}, {62500, -62500, 1}, 0xffff),
            (QuantisedVertex{62498, -62498, 1}));
}

// Server and client through messages, over many random cuts; a late joiner gets the same.
TEST(surface_change, both_sides_agree_over_random_cuts) {
  for (std::uint64_t seed = 0; seed < 4; ++seed) {
    Random random(seed);
    SurfaceLayout server = box();
    auto joined = read(message_of(server));
    ASSERT_TRUE(joined.ok()) << joined.error().message;
    SurfaceLayout client = std::move(*joined);
    for (int i = 0; i < 60; ++i) {
      SurfaceChange change = random_change(server, random);
      for (NewVertex& v : change.new_vertices) v.is_fixed = random.below(5) == 0;
      ASSERT_TRUE(apply(change, server).ok());
      proto::SurfaceChange message;
      write(change, server, message);
      const auto received = read(message, client);
      ASSERT_TRUE(received.ok()) << received.error().message;
      ASSERT_EQ(*received, without_nodes(change));
      const Status applied = apply(*received, client);
      ASSERT_TRUE(applied.ok()) << applied.error().message;
      ASSERT_EQ(client, without_nodes(server)) << "seed " << seed << ", change " << i;
      ASSERT_EQ(client.triangle_sum, client.compute_triangle_sum());
      ASSERT_TRUE(is_closed(client));
    }
    const auto late = read(message_of(server));
    ASSERT_TRUE(late.ok()) << late.error().message;
    EXPECT_EQ(*late, client);
  }
}

TEST(surface_change, what_is_wrong_is_named_and_changes_nothing) {
  SurfaceLayout layout = box();
  ASSERT_TRUE(apply(slit(layout), layout).ok());
  const SurfaceLayout before = layout;
  const VertexIndex a = layout.triangles.back()[0], b = layout.triangles.back()[1];
  const SurfaceChange good = split_edge(layout, a, b, 0x4000);
  const auto error_of = [&](const std::function<void(SurfaceChange&)>& spoil) {
    SurfaceChange change = good;
    spoil(change);
    const Status applied = apply(change, layout);
    EXPECT_EQ(layout, before);
    return applied.ok() ? std::string() : applied.error().message;
  };
  const auto expect = [&](const char* text, const std::function<void(SurfaceChange&)>& spoil) {
    EXPECT_NE(error_of(spoil).find(text), std::string::npos) << error_of(spoil);
  };
  const VertexIndex end(layout.vertex_count());
  expect("from epoch 0", [](auto& c) { c.from_epoch = 0; });
  expect("to 1", [](auto& c) { c.epoch = 1; });
  expect("sum of triangles", [](auto& c) { ++c.sum; });
  expect("sum of triangles", [](auto& c) { c.added[0].is_wound = !c.added[0].is_wound; });
  expect("2 m", [](auto& c) { c.new_vertices[0].rest_quanta.y = 62'501; });
  expect("made from", [&](auto& c) { c.new_vertices[0].a = end; });
  expect("made from", [](auto& c) { c.new_vertices[0].b = {}; });
  expect("has a vertex already", [](auto& c) { c.new_vertices[0].node = NodeIndex(0); });
  expect("two vertices of one node", [](auto& c) { c.new_vertices.push_back(c.new_vertices[0]); });
  expect("removed triangle out of range", [](auto& c) { c.removed.back() = TriangleIndex(99999); });
  expect("do not ascend", [](auto& c) { c.removed.push_back(c.removed.back()); });
  expect("gone already", [&](auto& c) {
    for (std::size_t i = 0; i < before.triangles.size(); ++i)
      if (!before.has_triangle(TriangleIndex(i))) c.removed = {TriangleIndex(i)};
  });
  expect("out of range", [&](auto& c) { c.added[0].corners[1] = VertexIndex(end.value + 1); });
  expect("out of range", [](auto& c) { c.added[0].corners[1] = {}; });
  expect("corner twice", [](auto& c) { c.added[0].corners[1] = c.added[0].corners[0]; });
  EXPECT_EQ(apply(good, layout).ok(), true);
}

// Flips bits of, or cuts short, the encoding of a message. What still reads and applies has the
// right sum; nothing else leaves a trace.
TEST(surface_change, damaged_messages_never_harm) {
  SurfaceLayout server = box();
  const SurfaceLayout client = without_nodes(server);
  const SurfaceChange change = slit(server);
  ASSERT_TRUE(apply(change, server).ok());
  proto::SurfaceChange message;
  write(change, server, message);
  const std::string good = message.SerializeAsString();
  Random random(3);
  int refused = 0;
  for (int i = 0; i < 6000; ++i) {
    std::string bytes = good;
    if (i % 3 == 0) bytes.resize(random.below(static_cast<std::uint32_t>(bytes.size())));
    for (std::uint32_t flips = random.below(4) + (i % 3 != 0); flips > 0 && !bytes.empty(); --flips)
      bytes[random.below(static_cast<std::uint32_t>(bytes.size()))] ^=
          static_cast<char>(1 << random.below(8));
    proto::SurfaceChange damaged;
    if (!damaged.ParseFromString(bytes)) continue;
    SurfaceLayout layout = client;
    const auto received = read(damaged, layout);
    const bool is_applied = received.ok() && apply(*received, layout).ok();
    if (is_applied) {
      ASSERT_EQ(layout.triangle_sum, layout.compute_triangle_sum());
    } else {
      ASSERT_EQ(layout, client) << i;
    }
    refused += !is_applied;
  }
  EXPECT_GT(refused, 1000);
}

TEST(surface_topology, damaged_messages_never_harm) {
  SurfaceLayout server = box();
  ASSERT_TRUE(apply(slit(server), server).ok());
  const std::string good = message_of(server).SerializeAsString();
  Random random(4);
  int refused = 0;
  for (int i = 0; i < 3000; ++i) {
    std::string bytes = good;
    if (i % 3 == 0) bytes.resize(random.below(static_cast<std::uint32_t>(bytes.size())));
    for (std::uint32_t flips = random.below(4) + (i % 3 != 0); flips > 0 && !bytes.empty(); --flips)
      bytes[random.below(static_cast<std::uint32_t>(bytes.size()))] ^=
          static_cast<char>(1 << random.below(8));
    proto::SurfaceTopology damaged;
    if (!damaged.ParseFromString(bytes)) continue;
    const auto layout = read(damaged);
    refused += !layout.ok();
    if (!layout.ok()) continue;
    ASSERT_EQ(layout->is_wound.size(), layout->triangles.size());
    for (std::size_t t = 0; t < layout->triangles.size(); ++t)
      for (const VertexIndex v : layout->triangles[t])
        ASSERT_EQ(v.value < layout->vertex_count(), layout->has_triangle(TriangleIndex(t)));
  }
  EXPECT_GT(refused, 500);
}

TEST(surface_topology, what_is_wrong_is_named) {
  SurfaceLayout layout = box();
  ASSERT_TRUE(apply(slit(layout), layout).ok());
  const auto expect = [&](const char* text, auto spoil) {
    proto::SurfaceTopology message = message_of(layout);
    spoil(message);
    const auto read_back = read(message);
    ASSERT_FALSE(read_back.ok()) << text;
    EXPECT_NE(read_back.error().message.find(text), std::string::npos) << read_back.error().message;
  };
  expect("rest_position_quanta: 0", [](auto& m) { m.clear_rest_position_quanta(); });
  expect("2 m", [](auto& m) { m.set_rest_position_quanta(4, -62'501); });
  expect("quantum_m", [](auto& m) { m.set_quantum_m(1); });
  expect("three corners", [](auto& m) { m.add_triangle(0); });
  expect("vertex out of range", [](auto& m) { m.set_triangle(0, 99999); });
  expect("fixed_vertex", [](auto& m) { m.add_fixed_vertex(99999); });
  expect("8,000,000", [](auto& m) { m.set_gap_runs(1, 0xffffffff); });
  expect("gap_runs", [](auto& m) { m.set_gap_runs(0, 99999); });
  expect("wound_runs", [](auto& m) { m.set_wound_runs(0, 99999); });
  expect("triangle_sum", [](auto& m) { m.set_gap_runs(0, m.gap_runs(0) - 1); });
  proto::SurfaceTopology old = message_of(box());  // as before 1.3
  old.clear_triangle_sum();
  EXPECT_EQ(*read(old), without_nodes(box()));
}

// The bound is what docs/the-wire.md states.
TEST(surface_change, costs_few_bytes) {
  Random random(11);
  SurfaceLayout layout = world::make_surface_layout(*catalogue::make_lattice({24, 12, 24, 0.01}));
  std::size_t bytes = 0, triangles = 0, vertices = 0;
  for (int i = 0; i < 40; ++i) {
    const SurfaceChange change = random_change(layout, random);
    ASSERT_TRUE(apply(change, layout).ok());
    proto::SurfaceChange message;
    write(change, layout, message);
    bytes += message.ByteSizeLong();
    triangles += change.added.size();
    vertices += change.new_vertices.size();
  }
  std::printf("%zu vertices: %zu bytes for %zu new vertices and %zu added triangles, %.1f each\n",
              layout.vertex_count(), bytes, vertices, triangles,
              static_cast<double>(bytes) / static_cast<double>(triangles));
  EXPECT_LT(bytes, 9 * triangles);
}

}  // namespace
}  // namespace trocar::wire
