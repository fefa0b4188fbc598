#include "server/tissue/world/far_poses.h"

#include <algorithm>

#include "common/base/checksum.h"

namespace trocar::world {
namespace {

constexpr float kPerMetre = 1 << 24, kMost = 1 << 30;

std::int32_t to_grid(float metres) {
  const float v = std::clamp(metres * kPerMetre, -kMost, kMost);
  return static_cast<std::int32_t>(v < 0 ? v - 0.5f : v + 0.5f);
}

// Folds a point into the hash of those added before it (FNV-1a over its three numbers).
std::uint64_t folded(std::uint64_t hash, const GridPoint& point) {
  for (const auto v : {point.x, point.y, point.z})
    hash = (hash ^ static_cast<std::uint32_t>(v)) * 0x100000001b3u;
  return hash;
}

}  // namespace

Vec3f displacement_of(const GridPoint& point) {
  return Vec3f{static_cast<float>(point.x), static_cast<float>(point.y),
               static_cast<float>(point.z)} *
         (1 / kPerMetre);
}

FarPoses::FarPoses(std::size_t node_count) {
  for (std::uint32_t i = 0; i < 2; ++i) {
    poses_[i].resize(node_count);
    taken_nodes_[i] = static_cast<std::uint32_t>(node_count);
    hashes_[i] = hash_of(i);
  }
}

void FarPoses::add_node(NodeIndex a, NodeIndex b, std::uint16_t t) {
  for (std::uint32_t i = 0; i < 2; ++i) {
    auto& pose = poses_[i];
    const auto between = [t](std::int32_t from, std::int32_t to) {
      const auto way = std::int64_t{to} - from;
      return static_cast<std::int32_t>(from + (way * std::int64_t{t} >> 16));
    };
    const GridPoint p = pose[a.value], q = pose[b.value];
    pose.push_back({between(p.x, q.x), between(p.y, q.y), between(p.z, q.z)});
    hashes_[i] = folded(hashes_[i], pose.back());
  }
}

bool FarPoses::begin_step(std::span<const Vec3f> displacements) {
  age_ = (age_ + 1) % kInterval;
  if (age_ == 0) record(displacements);
  return age_ == 0;
}

void FarPoses::record(std::span<const Vec3f> displacements) {
  const auto i = ++newest_ % 2;
  taken_nodes_[i] = static_cast<std::uint32_t>(displacements.size());
  std::ranges::transform(displacements, poses_[i].begin(), [](const Vec3f& u) {
    return GridPoint{to_grid(u.x), to_grid(u.y), to_grid(u.z)};
  });
  hashes_[i] = hash_of(i);
}

std::uint64_t FarPoses::hash_of(std::uint32_t number) const {
  const auto& pose = poses_[number % 2];
  const auto taken = taken_nodes_[number % 2];
  auto hash =
      xxh3_64({reinterpret_cast<const std::uint8_t*>(pose.data()), taken * sizeof(GridPoint)});
  for (std::size_t n = taken; n < pose.size(); ++n) hash = folded(hash, pose[n]);
  return hash;
}

void FarPoses::visit_state(StateArchive& archive) {
  archive.value(newest_);
  archive.value(age_);
  if (archive.is_reading() && age_ >= kInterval) archive.fail();
  for (std::uint32_t i = 0; i < 2; ++i) {
    archive.value(hashes_[i]);
    if (archive.is_hashing()) continue;
    archive.value(taken_nodes_[i]);
    if (archive.is_reading() && taken_nodes_[i] > poses_[i].size()) {
      taken_nodes_[i] = 0;
      archive.fail();
    }
    if (newest_ > 0)
      archive.fixed_array(poses_[i]);
    else if (archive.is_reading())
      std::ranges::fill(poses_[i], GridPoint{});
    if (archive.is_reading() && hashes_[i] != hash_of(i)) archive.fail();
  }
}

}  // namespace trocar::world
