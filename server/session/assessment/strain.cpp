#include "server/session/assessment/strain.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "common/base/version.h"
#include "common/journal/session_journal.h"
#include "common/math/box.h"
#include "common/math/symmetric.h"
#include "server/session/recording/recorded_session.h"

namespace trocar::assessment {
namespace {

constexpr double kCellM = 0.002;
constexpr double kMostCells = 4e6;
constexpr Tick kPeriod = 64, kProgressPeriod = 1000;

// Rows of the inverse of the matrix with these columns.
std::array<Vec3d, 3> reciprocals(const std::array<Vec3d, 3>& e) {
  const double volume = dot(e[0], cross(e[1], e[2]));
  return {cross(e[1], e[2]) * (1 / volume), cross(e[2], e[0]) * (1 / volume),
          cross(e[0], e[1]) * (1 / volume)};
}

std::array<Vec3d, 3> edges_of(const std::array<Vec3d, 4>& corners) {
  return {corners[1] - corners[0], corners[2] - corners[0], corners[3] - corners[0]};
}

// Returns the greatest principal strain, or 0 where it is surely below the limit.
double strain_of(const std::array<Vec3d, 4>& rest, const std::array<Vec3d, 4>& now, double limit) {
  const auto r = reciprocals(edges_of(rest));
  const auto d = edges_of(now);
  SymMat3<double> c;  // right Cauchy-Green
  c.add_outer(r[0] * d[0].x + r[1] * d[1].x + r[2] * d[2].x, 1);
  c.add_outer(r[0] * d[0].y + r[1] * d[1].y + r[2] * d[2].y, 1);
  c.add_outer(r[0] * d[0].z + r[1] * d[1].z + r[2] * d[2].z, 1);
  const double xx = c.xx - 1, yy = c.yy - 1, zz = c.zz - 1;
  const double norm = xx * xx + yy * yy + zz * zz + 2 * (c.xy * c.xy + c.xz * c.xz + c.yz * c.yz);
  const double most = (1 + limit) * (1 + limit) - 1;
  if (norm < most * most) return 0;
  return std::sqrt(largest_principal(c).value) - 1;
}

}  // namespace

StrainMap::StrainMap(const organ::Organ& organ, double limit) : limit_(limit) {
  Box<double> box;
  for (const auto& place : organ.mesh.rest_positions) box.include(place);
  const auto size = box.most - box.least;
  width_m_ = std::max(kCellM, std::cbrt(size.x * size.y * size.z / kMostCells));
  origin_ = box.least;
  const auto count = [&](double length) { return static_cast<std::size_t>(length / width_m_) + 1; };
  size_ = {count(size.x), count(size.y), count(size.z)};
  cells_.resize(size_[0] * size_[1] * size_[2]);
}

Vec3d StrainMap::centre_of(std::size_t cell) const {
  const auto x = cell % size_[0], y = cell / size_[0] % size_[1], z = cell / size_[0] / size_[1];
  return origin_ + Vec3d{static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5,
                         static_cast<double>(z) + 0.5} *
                       width_m_;
}

void StrainMap::mark(const std::array<Vec3d, 4>& rest) {
  Box<double> box;
  for (const auto& corner : rest) box.include(corner - origin_);
  const auto r = reciprocals(edges_of(rest));
  const auto cell_at = [&](double place, std::size_t size) {
    return std::min(static_cast<std::size_t>(std::max(0.0, place / width_m_)), size - 1);
  };
  for (auto z = cell_at(box.least.z, size_[2]); z <= cell_at(box.most.z, size_[2]); ++z)
    for (auto y = cell_at(box.least.y, size_[1]); y <= cell_at(box.most.y, size_[1]); ++y)
      for (auto x = cell_at(box.least.x, size_[0]); x <= cell_at(box.most.x, size_[0]); ++x) {
        const auto cell = (z * size_[1] + y) * size_[0] + x;
        const auto at = centre_of(cell) - rest[0];
        const double a = dot(r[0], at), b = dot(r[1], at), c = dot(r[2], at);
        if (a >= 0 && b >= 0 && c >= 0 && a + b + c <= 1) cells_[cell] = true;
      }
}

void StrainMap::look(const step::Simulation& simulation) {
  const auto& topology = simulation.state().cuts.topology();
  const auto& world = simulation.state().world;
  marked_.resize(topology.tet_count());
  for (std::uint32_t t = 0; t < topology.tet_count(); ++t) {
    if (!topology.has_tet(TetIndex(t))) continue;
    const auto& tet = topology.tet(TetIndex(t));
    std::array<Vec3d, 4> rest, now;
    for (std::size_t i = 0; i < 4; ++i) {
      rest[i] = topology.rest()[tet[i].value];
      now[i] = rest[i] + to_double(world.displacements[tet[i].value]);
    }
    const double strain = strain_of(rest, now, limit_);
    if (strain > greatest_) greatest_ = strain, greatest_tick_ = world.tick;
    if (strain <= limit_ || marked_[t] == tet) continue;
    marked_[t] = tet;
    mark(rest);
  }
}

double StrainMap::volume_m3() const {
  return static_cast<double>(std::ranges::count(cells_, true)) * width_m_ * width_m_ * width_m_;
}

double StrainMap::volume_within_m3(const lesson::Structure& structure) const {
  std::size_t count = 0;
  for (std::size_t cell = 0; cell < cells_.size(); ++cell)
    count += cells_[cell] && structure.distance_m(centre_of(cell)) <= 0;
  return static_cast<double>(count) * width_m_ * width_m_ * width_m_;
}

Result<StrainDamage> measure_strain(const std::string& path, double limit,
                                    const lesson::Lesson* lesson,
                                    const std::function<void(Tick, Tick last)>& progress) {
  auto journal = journal::SessionJournal::open(path);
  if (!journal) return journal.error();
  const auto& info = (*journal)->info();
  const auto refuse = [&](const std::string& why) {
    return Error{ErrorCode::BadFile, path + ": strain cannot be measured: " + why};
  };
  if (info.sim_version != kSimVersion)
    return refuse(fmt::format("it was recorded with sim_version {}, this program has {}",
                              info.sim_version, kSimVersion));
  if (info.begins_with_snapshot() || info.gap_messages > 0)
    return refuse("it has a gap, or does not begin with the organ at rest");
  auto organ = recording::recorded_organ(**journal, path);
  if (!organ) return organ.error();
  StrainMap map(*organ, limit);
  step::Simulation simulation(std::move(*organ));
  StrainDamage damage{.limit = limit};
  const auto read =
      recording::read_ticks(**journal, [&](const step::TickRecord& record, bool&) -> Status {
        const auto& done = simulation.tick(record.inputs, record.decisions);
        simulation.pop_frame();
        damage.cut_m2 += done.cut.opened_area_m2 - done.cut.torn_area_m2;
        damage.torn_m2 += done.cut.torn_area_m2;
        if (record.tick != simulation.current_tick() || done.state_hash != record.state_hash)
          return refuse(fmt::format("tick {} does not come out again", record.tick));
        if (record.tick % kPeriod == 0) map.look(simulation);
        if (progress && record.tick % kProgressPeriod == 0) progress(record.tick, info.last_tick);
        return {};
      });
  if (!read) return read.error();
  damage.volume_m3 = map.volume_m3();
  damage.greatest = map.greatest(), damage.greatest_tick = map.greatest_tick();
  if (lesson != nullptr)
    for (const auto& structure : lesson->structures)
      damage.structures.push_back({structure.name, map.volume_within_m3(structure)});
  return damage;
}

}  // namespace trocar::assessment
