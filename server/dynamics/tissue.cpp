#include "server/dynamics/tissue.h"

#include <algorithm>

#include "server/dynamics/hyperelastic.h"
#include "server/dynamics/springs.h"
#include "server/dynamics/tensor_mass.h"

namespace trocar::dynamics {
namespace {

using scene::ElasticLaw;

template <typename Predicate>
bool any_material(const scene::Organ& organ, Predicate&& is) {
  return is(organ.material) ||
         std::ranges::any_of(organ.regions, [&](const auto& r) { return is(r.material); });
}

bool has_law(const scene::Organ& organ, ElasticLaw law) {
  return any_material(organ, [&](const scene::Material& m) { return m.elastic_law == law; });
}

bool averages_volume(const scene::Organ& organ) {
  return any_material(organ, [](const scene::Material& m) {
    return m.elastic_law == ElasticLaw::NeoHookean && m.has_averaged_volume;
  });
}

}  // namespace

Tissue::Tissue(const scene::Organ& organ)
    : groups_(organ, averages_volume(organ) ? Coupling::Stars : Coupling::Elements),
      follows_moves_(averages_volume(organ)) {
  auto springs = std::make_unique<Springs>(organ, groups_);
  if (springs->has_any()) energies_.push_back(std::move(springs));
  if (has_law(organ, ElasticLaw::TensorMass))
    energies_.push_back(std::make_unique<TensorMass>(organ, groups_));
  if (has_law(organ, ElasticLaw::NeoHookean))
    energies_.push_back(std::make_unique<NeoHookean>(organ, groups_, follows_moves_));
}

void Tissue::begin_step(float inverse_dt) {
  for (const auto& energy : energies_) energy->begin_step(inverse_dt);
}
void Tissue::begin_group(Group group, const Float4* start) {
  for (const auto& energy : energies_) energy->begin_group(group, start);
}
void Tissue::restart_group(Group group, const Float4* x) {
  for (const auto& energy : energies_)
    if (energy->follows_moves()) energy->restart_group(group, x);
}
void Tissue::after_move(Group group, const Vec8& dx, const Scratch& scratch) {
  for (const auto& energy : energies_)
    if (energy->follows_moves()) energy->after_move(group, dx, scratch);
}

double Tissue::energy_j(std::span<const Vec3f> displacements) const {
  std::vector<Vec3d> per_slot(groups_.slot_count());
  for (std::uint32_t n = 0; n < displacements.size(); ++n)
    per_slot[groups_.slot_of(NodeIndex(n))] = to_double(displacements[n]);
  double energy = 0;
  for (const auto& e : energies_) energy += e->energy_j(per_slot);
  return energy;
}

}  // namespace trocar::dynamics
