#include "server/tissue/world/relaxation_state.h"

#include <algorithm>

#include "server/organs/organ/any_material.h"

namespace trocar::world {
namespace {

std::size_t terms_of(const material::Material& material) {
  return material.elastic_law == material::ElasticLaw::Measured
             ? material.measured.relaxation.size()
             : 0;
}

}  // namespace

std::size_t RelaxationState::terms_of(const organ::Organ& organ) {
  std::size_t most = 0;
  for (std::size_t i = 0; i <= organ.regions.size(); ++i)
    most =
        std::max(most, world::terms_of(organ::material_at(organ, static_cast<std::uint16_t>(i))));
  return most;
}

bool RelaxationState::has_nodal(const organ::Organ& organ) {
  return organ::any_material(organ, [](const material::Material& m) {
    return world::terms_of(m) > 0 && m.has_averaged_strain;
  });
}

RelaxationState::RelaxationState(const organ::Organ& organ) {
  const auto terms = terms_of(organ), nodes = organ.mesh.node_count();
  if (terms == 0) return;
  tets_ = StressHistory(terms, organ.mesh.tets.size());
  if (has_nodal(organ)) nodal_ = StressHistory(terms, nodes);
  forces_.resize(nodes);
}

void RelaxationState::add_node(NodeIndex parent) {
  if (is_empty()) return;
  nodal_.inherit(forces_.size(), parent.value);
  forces_.emplace_back();
}

void RelaxationState::visit_state(StateArchive& archive) {
  if (is_empty()) return;
  tets_.visit_hash(archive);
  nodal_.visit_hash(archive);
  archive.fixed_array(forces_);
  if (archive.is_hashing()) return;
  tets_.visit_values(archive);
  nodal_.visit_values(archive);
  if (archive.is_reading() &&
      !std::ranges::all_of(forces_, [](const Vec3f& f) { return is_finite(f); }))
    archive.fail();
}

}  // namespace trocar::world
