#include "common/wire/surface_messages.h"

#include <algorithm>

#include "common/base/varint.h"
#include "proto/wire.pb.h"

namespace trocar::wire {
namespace {

using Runs = google::protobuf::RepeatedField<std::uint32_t>;

Error bad(const char* message, const std::string& what) {
  return {ErrorCode::BadMessage, std::string(message) + "." + what};
}

std::int32_t step(VertexIndex from, VertexIndex to) {
  return static_cast<std::int32_t>(to.value - from.value);
}
// Wraps around where the message is wrong; every index is compared with its limit afterwards.
VertexIndex moved(VertexIndex from, std::int32_t by) {
  return VertexIndex(from.value + static_cast<std::uint32_t>(by));
}
QuantisedVertex sum_of(const QuantisedVertex& a, const QuantisedVertex& b) {
  const auto add = [](std::int32_t x, std::int32_t y) {
    return static_cast<std::int32_t>(static_cast<std::uint32_t>(x) + static_cast<std::uint32_t>(y));
  };
  return {add(a.x, b.x), add(a.y, b.y), add(a.z, b.z)};
}

// Lengths of runs, the first of `false` ones; nothing if all are.
class RunWriter {
 public:
  explicit RunWriter(Runs& runs) : runs_(runs) {}
  void add(bool value) {
    if (value != value_) {
      runs_.Add(length_);
      value_ = value;
      length_ = 0;
    }
    ++length_;
  }
  void finish() {
    if (value_) runs_.Add(length_);
  }

 private:
  Runs& runs_;
  std::uint32_t length_ = 0;
  bool value_ = false;
};

// Flags of `count` from runs; those past the last run are false. Nothing if the runs exceed it.
Result<std::vector<std::uint8_t>> read_runs(const Runs& runs, std::size_t count,
                                            const char* message, const char* field) {
  std::vector<std::uint8_t> flags(count);
  std::size_t at = 0;
  bool value = false;
  for (const std::uint32_t length : runs) {
    if (length > count - at)
      return bad(message, std::string(field) + ": runs exceed the triangles");
    std::fill_n(flags.begin() + static_cast<std::ptrdiff_t>(at), length, std::uint8_t{value});
    at += length;
    value = !value;
  }
  return flags;
}

// ---- topology ----

constexpr const char* kTopology = "SurfaceTopology";

Status read_vertices(const proto::SurfaceTopology& message, SurfaceLayout& layout) {
  const int numbers = message.rest_position_quanta_size();
  if (numbers == 0 || numbers % 3 != 0 ||
      static_cast<std::size_t>(numbers / 3) > kMaxSurfaceVertices)
    return bad(kTopology, "rest_position_quanta: " + std::to_string(numbers) +
                              " numbers are not 1 to 4,000,000 vertices of three");
  layout.rest_quanta.reserve(static_cast<std::size_t>(numbers / 3));
  for (int i = 0; i < numbers; i += 3) {
    for (int axis = 0; axis < 3; ++axis)
      if (const auto v = message.rest_position_quanta(i + axis);
          v < -kMaxRestQuanta || v > kMaxRestQuanta)
        return bad(kTopology, "rest_position_quanta: a vertex is more than 2 m from the origin");
    layout.rest_quanta.push_back({message.rest_position_quanta(i),
                                  message.rest_position_quanta(i + 1),
                                  message.rest_position_quanta(i + 2)});
  }
  layout.node_of_vertex.resize(layout.rest_quanta.size());
  for (const std::uint32_t v : message.fixed_vertex()) {
    if (v >= layout.vertex_count()) return bad(kTopology, "fixed_vertex: vertex out of range");
    layout.fixed_vertices.push_back(VertexIndex(v));
  }
  return {};
}

Status read_triangles(const proto::SurfaceTopology& message, SurfaceLayout& layout) {
  if (message.triangle_size() % 3 != 0) return bad(kTopology, "triangle: not three corners each");
  for (const std::uint32_t v : message.triangle())
    if (v >= layout.vertex_count()) return bad(kTopology, "triangle: vertex out of range");
  const auto present = static_cast<std::size_t>(message.triangle_size() / 3);
  std::size_t count = present;
  for (int i = 1; i < message.gap_runs_size(); i += 2) count += message.gap_runs(i);
  if (present > kMaxSurfaceTriangles || count > kMaxSurfaceTriangles)
    return bad(kTopology, "triangle: more than 8,000,000");
  const auto gaps = read_runs(message.gap_runs(), count, kTopology, "gap_runs");
  if (!gaps) return gaps.error();
  const auto wounds = read_runs(message.wound_runs(), present, kTopology, "wound_runs");
  if (!wounds) return wounds.error();
  layout.triangles.resize(count);
  layout.is_wound.resize(count);
  int next = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if ((*gaps)[i] != 0) continue;
    for (VertexIndex& corner : layout.triangles[i]) corner = VertexIndex(message.triangle(next++));
    layout.is_wound[i] = (*wounds)[static_cast<std::size_t>(next / 3 - 1)];
  }
  layout.triangle_sum = layout.compute_triangle_sum();
  if (message.has_triangle_sum() && message.triangle_sum() != layout.triangle_sum)
    return bad(kTopology, "triangle_sum: differs from that of its triangles");
  return {};
}

// ---- change ----

constexpr const char* kChange = "SurfaceChange";

void write_vertices(const SurfaceChange& change, const SurfaceLayout& layout,
                    proto::SurfaceChange& message) {
  const auto rest = [&](VertexIndex v) { return layout.rest_quanta[v.value]; };
  VertexIndex last_a(0);
  QuantisedVertex last_rest;
  std::uint32_t last_fixed = 0;
  for (std::size_t i = 0; i < change.new_vertices.size(); ++i) {
    const NewVertex& v = change.new_vertices[i];
    const QuantisedVertex from = v.has_parents() ? between(rest(v.a), rest(v.b), v.t) : last_rest;
    const QuantisedVertex offset = v.rest_quanta - from;
    const bool has_offset = !(offset == QuantisedVertex{});
    if (v.has_parents()) {
      message.add_origin(1 + (zigzag(step(last_a, v.a)) << 1) + std::uint32_t{has_offset});
      message.add_origin(zigzag(step(v.a, v.b)));
      if (v.a != v.b) message.add_origin(v.t);
      last_a = v.a;
    } else {
      message.add_origin(0);
    }
    if (has_offset || !v.has_parents())
      for (const std::int32_t c : {offset.x, offset.y, offset.z}) message.add_rest_offset_quanta(c);
    last_rest = v.rest_quanta;
    if (!v.is_fixed) continue;
    message.add_fixed(static_cast<std::uint32_t>(i) - last_fixed);
    last_fixed = static_cast<std::uint32_t>(i);
  }
}

// Takes numbers from a field one by one; zero past its end.
template <typename Field>
class FieldReader {
 public:
  explicit FieldReader(const Field& field) : field_(field) {}
  bool is_at_end() const { return at_ >= field_.size(); }
  bool ok() const { return at_ <= field_.size(); }
  auto take() {
    const int i = at_++;
    return i < field_.size() ? field_.Get(i) : typename Field::value_type{};
  }

 private:
  const Field& field_;
  int at_ = 0;
};

Status read_vertices(const proto::SurfaceChange& message, const SurfaceLayout& before,
                     SurfaceChange& change) {
  const std::size_t first = before.vertex_count();
  FieldReader origin(message.origin());
  FieldReader offset(message.rest_offset_quanta());
  VertexIndex last_a(0);
  QuantisedVertex last_rest;
  while (!origin.is_at_end()) {
    NewVertex& v = change.new_vertices.emplace_back();
    const std::size_t end = first + change.new_vertices.size() - 1;
    const std::uint32_t code = origin.take();
    QuantisedVertex from = last_rest;
    if (code != 0) {
      v.a = last_a = moved(last_a, unzigzag((code - 1) >> 1));
      v.b = moved(v.a, unzigzag(origin.take()));
      if (std::max(v.a, v.b).value >= end) return bad(kChange, "origin: parent out of range");
      if (v.a != v.b) {
        const std::uint32_t t = origin.take();
        if (t > 0xffff) return bad(kChange, "origin: share above 65535");
        v.t = static_cast<std::uint16_t>(t);
      }
      const auto rest = [&](VertexIndex p) {
        return p.value < first ? before.rest_quanta[p.value]
                               : change.new_vertices[p.value - first].rest_quanta;
      };
      from = between(rest(v.a), rest(v.b), v.t);
    }
    if (code == 0 || ((code - 1) & 1) != 0) {
      const std::int32_t x = offset.take(), y = offset.take(), z = offset.take();
      from = sum_of(from, {x, y, z});
    }
    for (const std::int32_t c : {from.x, from.y, from.z})
      if (c < -kMaxRestQuanta || c > kMaxRestQuanta)
        return bad(kChange, "rest_offset_quanta: a vertex is more than 2 m from the origin");
    v.rest_quanta = last_rest = from;
  }
  if (!origin.ok() || !offset.ok() || !offset.is_at_end())
    return bad(kChange, "origin: does not go with rest_offset_quanta");
  std::uint64_t fixed = 0;
  for (const std::uint32_t by : message.fixed()) {
    fixed += by;
    if (fixed >= change.new_vertices.size()) return bad(kChange, "fixed: vertex out of range");
    change.new_vertices[static_cast<std::size_t>(fixed)].is_fixed = true;
  }
  return {};
}

}  // namespace

void write(const SurfaceLayout& layout, const std::string& organ_name,
           proto::SurfaceTopology& message) {
  message.set_epoch(layout.epoch);
  message.set_quantum_m(kQuantumMetres);
  message.set_organ_name(organ_name);
  message.mutable_rest_position_quanta()->Reserve(static_cast<int>(3 * layout.vertex_count()));
  for (const auto& vertex : layout.rest_quanta)
    for (const std::int32_t c : {vertex.x, vertex.y, vertex.z}) message.add_rest_position_quanta(c);
  RunWriter gaps(*message.mutable_gap_runs()), wounds(*message.mutable_wound_runs());
  message.mutable_triangle()->Reserve(static_cast<int>(3 * layout.triangles.size()));
  for (std::size_t i = 0; i < layout.triangles.size(); ++i) {
    const bool is_present = layout.has_triangle(TriangleIndex(i));
    gaps.add(!is_present);
    if (!is_present) continue;
    wounds.add(layout.is_wound[i] != 0);
    for (const auto vertex : layout.triangles[i]) message.add_triangle(vertex.value);
  }
  gaps.finish();
  wounds.finish();
  message.set_triangle_sum(layout.triangle_sum);
  for (const auto vertex : layout.fixed_vertices) message.add_fixed_vertex(vertex.value);
}

Result<SurfaceLayout> read(const proto::SurfaceTopology& message) {
  if (message.quantum_m() != kQuantumMetres)
    return bad(kTopology, "quantum_m: this program knows a grid of 32 um only");
  SurfaceLayout layout;
  layout.epoch = message.epoch();
  if (Status done = read_vertices(message, layout); !done.ok()) return done.error();
  if (Status done = read_triangles(message, layout); !done.ok()) return done.error();
  return layout;
}

void write(const SurfaceChange& change, const SurfaceLayout& layout,
           proto::SurfaceChange& message) {
  message.set_from_epoch(change.from_epoch);
  message.set_epoch(change.epoch);
  write_vertices(change, layout, message);
  TriangleIndex last_removed(0);
  for (const TriangleIndex number : change.removed) {
    message.add_removed(number.value - last_removed.value);
    last_removed = number;
  }
  VertexIndex last_corner(0);
  RunWriter wounds(*message.mutable_wound_runs());
  for (const NewTriangle& triangle : change.added) {
    for (const VertexIndex corner : triangle.corners) {
      message.add_corner(triangle.is_gap() ? 0 : step(last_corner, corner));
      if (!triangle.is_gap()) last_corner = corner;
    }
    wounds.add(triangle.is_wound);
  }
  wounds.finish();
  for (const auto& name : change.regions) message.add_region(name);
  message.set_triangle_sum(change.sum);
}

Result<SurfaceChange> read(const proto::SurfaceChange& message, const SurfaceLayout& before) {
  SurfaceChange change;
  change.from_epoch = message.from_epoch();
  change.epoch = message.epoch();
  change.sum = message.triangle_sum();
  if (change.from_epoch != before.epoch)
    return bad(kChange, "from_epoch: is " + std::to_string(change.from_epoch) +
                            ", the surface has " + std::to_string(before.epoch));
  if (Status done = read_vertices(message, before, change); !done.ok()) return done.error();
  if (message.region_size() > kMaxChangeRegions)
    return bad(kChange, "region: more than " + std::to_string(kMaxChangeRegions) + " names");
  change.regions.assign(message.region().begin(), message.region().end());
  std::uint64_t number = 0;
  change.removed.reserve(static_cast<std::size_t>(message.removed_size()));
  for (const std::uint32_t by : message.removed()) {
    number += by;
    if (number >= before.triangles.size()) return bad(kChange, "removed: triangle out of range");
    change.removed.push_back(TriangleIndex(static_cast<std::uint32_t>(number)));
  }
  if (message.corner_size() % 3 != 0) return bad(kChange, "corner: not three each");
  const auto added = static_cast<std::size_t>(message.corner_size() / 3);
  const auto wounds = read_runs(message.wound_runs(), added, kChange, "wound_runs");
  if (!wounds) return wounds.error();
  VertexIndex corner(0);
  FieldReader corners(message.corner());
  change.added.resize(added);
  for (std::size_t i = 0; i < added; ++i) {
    auto& slots = change.added[i].corners;
    for (VertexIndex& slot : slots) slot = corner = moved(corner, corners.take());
    if (slots[0] == slots[1] && slots[1] == slots[2]) slots = {};
    change.added[i].is_wound = (*wounds)[i] != 0;
  }
  return change;
}

}  // namespace trocar::wire
