#include "tests/cutting/cut_organ.h"

#include <cmath>

#include "common/base/bytes.h"
#include "common/base/checksum.h"
#include "common/base/timing.h"

namespace trocar::cutting::testing {
namespace {

organ::Organ organ_of(mesh::TetMesh mesh) {
  organ::Organ organ;
  organ.name = "box";
  organ.mesh = std::move(mesh);
  organ.mesh.build_adjacency();
  organ.node_masses_kg = organ::lumped_masses(organ);
  return organ;
}

// These are the five tets of the cell at the origin; every second cell is mirrored.
constexpr int kEven[5][4] = {{0, 1, 2, 4}, {3, 2, 1, 7}, {5, 4, 7, 1}, {6, 7, 4, 2}, {1, 2, 4, 7}};

}  // namespace

organ::Organ box_organ(int nx, int ny, int nz, double cell_m, double jitter, std::uint64_t seed) {
  mesh::TetMesh mesh;
  trocar::testing::Random random(seed);
  const int size[3] = {nx, ny, nz};
  for (int k = 0; k <= nz; ++k)
    for (int j = 0; j <= ny; ++j)
      for (int i = 0; i <= nx; ++i) {
        const int at[3] = {i, j, k};
        double p[3];
        for (int axis = 0; axis < 3; ++axis) {
          const double off = random.between(-jitter, jitter);
          p[axis] = at[axis] - size[axis] / 2.0;
          if (at[axis] > 0 && at[axis] < size[axis]) p[axis] += off;
        }
        mesh.rest_positions.push_back(Vec3d{p[0], p[1], p[2]} * cell_m);
      }
  for (int k = 0; k < nz; ++k)
    for (int j = 0; j < ny; ++j)
      for (int i = 0; i < nx; ++i)
        for (const auto& corners : kEven) {
          mesh::Tet tet;
          for (std::size_t c = 0; c < 4; ++c) {
            const int bit = corners[c];
            int dx = bit & 1;
            const int dy = bit >> 1 & 1, dz = bit >> 2 & 1;
            if ((i + j + k) % 2 != 0) dx = 1 - dx;
            tet[c] = NodeIndex((i + dx) + (nx + 1) * ((j + dy) + (ny + 1) * (k + dz)));
          }
          std::array<Vec3d, 4> places;
          for (std::size_t c = 0; c < 4; ++c) places[c] = mesh.rest_positions[tet[c].value];
          if (six_volumes(places) < 0) std::swap(tet[0], tet[1]);
          mesh.tets.push_back(tet);
        }
  return organ_of(std::move(mesh));
}

organ::Organ tet_organ() {
  mesh::TetMesh mesh;
  mesh.rest_positions = {
      {0.05, 0.05, 0.05}, {-0.05, -0.05, 0.05}, {-0.05, 0.05, -0.05}, {0.05, -0.05, -0.05}};
  mesh.tets = {{NodeIndex(0), NodeIndex(1), NodeIndex(2), NodeIndex(3)}};
  std::array<Vec3d, 4> places;
  std::copy(mesh.rest_positions.begin(), mesh.rest_positions.end(), places.begin());
  if (six_volumes(places) < 0) std::swap(mesh.tets[0][0], mesh.tets[0][1]);
  return organ_of(std::move(mesh));
}

double least_dihedral_sine(const topology::Topology& topology) {
  double least = 1;
  for (std::uint32_t t = 0; t < topology.tet_count(); ++t)
    if (topology.has_tet(TetIndex(t)))
      least = std::min(least, least_sine(rest_corners(topology, topology.tet(TetIndex(t)))));
  return least;
}

double total_mass(const topology::Topology& topology) {
  double total = 0;
  for (std::uint32_t n = 0; n < topology.node_count(); ++n)
    if (topology.has_node(NodeIndex(n))) total += topology.lumped_mass(NodeIndex(n));
  return total;
}

std::uint64_t topology_hash(const topology::Topology& topology) {
  std::vector<double> numbers;
  for (std::uint32_t n = 0; n < topology.node_count(); ++n) {
    const NodeIndex node(n);
    numbers.push_back(topology.has_node(node));
    for (const auto& p : {topology.rest()[n], topology.stress_free()[n]})
      numbers.insert(numbers.end(), {p.x, p.y, p.z});
    for (const auto t : topology.tets_of(node)) numbers.push_back(t.value);
    for (const auto r : topology.regions_of(node)) numbers.push_back(r);
  }
  for (std::uint32_t t = 0; t < topology.tet_count(); ++t) {
    for (const auto node : topology.tet(TetIndex(t))) numbers.push_back(node.value);
    numbers.push_back(topology.material_of(TetIndex(t)));
  }
  return xxh3_64(
      {reinterpret_cast<const std::uint8_t*>(numbers.data()), numbers.size() * sizeof(double)});
}

CutOrgan::CutOrgan(organ::Organ organ, const Settings& settings)
    : organ_(std::make_unique<const organ::Organ>(std::move(organ))),
      topology_(*organ_),
      copy_(*organ_),
      copy_places_(copy_),
      cutter_(topology_, settings),
      has_floor_(settings.make_splitter == nullptr),
      volume_(total_volume(topology_)),
      mass_(total_mass(topology_)),
      surface_(surface_area(topology_)) {}

Path straight_path(const Edge& from, const Edge& to, double step_m) {
  double motion = 0;
  for (std::size_t i = 0; i < from.size(); ++i) motion = std::max(motion, length(to[i] - from[i]));
  const double steps = std::max(1.0, std::ceil(motion / step_m));
  Path path;
  for (double s = 0; s <= steps; ++s) {
    auto& edge = path.emplace_back(from);
    for (std::size_t i = 0; i < from.size(); ++i) edge[i] += (to[i] - from[i]) * (s / steps);
  }
  return path;
}

void CutOrgan::tick() {
  const auto start = thread_cpu_ns();
  cutter_.cut(displacements, output_, travel_m);
  last_ns_ = thread_cpu_ns() - start;
  if (const auto status = apply(output_.events, copy_, copy_places_); !status && failure_.empty())
    failure_ = "replay: " + status.error().message;
  history_.append(output_.events);
  if (!displacements.empty()) {
    displacements.resize(topology_.node_count());
    for (const auto& made : output_.new_nodes) {
      const auto a = displacements[made.a.value], b = displacements[made.b.value];
      displacements[made.node.value] = a + (b - a) * (made.t / 65536.f);
    }
  }
  total_.opened_area_m2 += output_.opened_area_m2;
  total_.waiting_area_m2 += output_.waiting_area_m2;
  total_.crossed_tets += output_.crossed_tets;
  total_.splits += output_.splits;
  total_.labels += output_.labels;
  total_.refused_splits += output_.refused_splits;
  total_.pinch_splits += output_.pinch_splits;
  total_.four_tets += output_.four_tets;
  total_.six_tets += output_.six_tets;
  total_.other_tets += output_.other_tets;
  total_.moved_nodes += output_.moved_nodes;
  total_.refused_moves += output_.refused_moves;
  total_.smoothed_nodes += output_.smoothed_nodes;
  total_.is_behind = output_.is_behind;
}

Bytes CutOrgan::state() {
  Bytes bytes;
  auto archive = world::StateArchive::writing(bytes);
  cutter_.visit_state(archive);
  return bytes;
}

std::string CutOrgan::resume(CutOrgan& other) {
  std::vector<topology::NewNode> made;
  if (const auto status = cutter_.repeat(other.history_, made); !status)
    return status.error().message;
  if (const auto status = apply(other.history_, copy_, copy_places_); !status)
    return status.error().message;
  const auto bytes = other.state();
  auto archive = world::StateArchive::reading(bytes);
  cutter_.visit_state(archive);
  if (!archive.ok() || !archive.at_end()) return "its state cannot be read";
  history_ = other.history_;
  total_ = other.total_;
  displacements = other.displacements;
  return {};
}

void CutOrgan::run_until_idle() {
  for (int i = 0; i < 100'000 && !cutter_.is_idle(); ++i) tick();
  if (!cutter_.is_idle() && failure_.empty()) failure_ = "never idle";
}

void CutOrgan::stroke(const Path& path, std::uint32_t blade) {
  for (const auto& edge : path) {
    if (!cutter_.move(blade, edge) && failure_.empty()) failure_ = "a blade was refused";
    tick();
  }
  cutter_.lift(blade);
  run_until_idle();
}

std::string CutOrgan::check() const {
  if (!failure_.empty()) return failure_;
  if (const auto status = validate(topology_); !status) return status.error().message;
  if (!(std::abs(total_volume(topology_) - volume_) <= 1e-12 * volume_)) return "volume not kept";
  if (!(std::abs(total_mass(topology_) - mass_) <= 1e-12 * mass_)) return "mass not kept";
  const double surface = surface_ + 2 * total_.opened_area_m2;
  if (!(std::abs(surface_area(topology_) - surface) <= 1e-9 * surface))
    return "not the wound's area";
  const double floor =
      has_floor_ ? cutter_.floor_sine() * (total_.pinch_splits > 0 ? 0.5 : 1) : 1e-12;
  if (!(least_dihedral_sine(topology_) >= floor * (1 - 1e-9))) return "angle below the floor";
  if (topology_hash(topology_) != topology_hash(copy_)) return "the copy differs";
  return {};
}

}  // namespace trocar::cutting::testing
