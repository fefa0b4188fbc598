#include "server/tissue/dynamics/tissue.h"

#include <algorithm>

#include "server/organs/organ/any_material.h"
#include "server/tissue/dynamics/hyperelastic.h"
#include "server/tissue/dynamics/springs.h"
#include "server/tissue/dynamics/tensor_mass.h"

namespace trocar::dynamics {
namespace {

using material::ElasticLaw;

bool has_law(const organ::Organ& organ, ElasticLaw law) {
  return organ::any_material(organ,
                             [&](const material::Material& m) { return m.elastic_law == law; });
}

// Nothing where the material has another energy.
std::optional<ReducedPolynomialLaw> law_of(const material::Material& material,
                                           ReducedPolynomialLaw law) {
  if (material.elastic_law != ElasticLaw::Measured ||
      material.measured.energy != material::StrainEnergy::ReducedPolynomial)
    return {};
  const auto& c = material.measured.coefficients_pa;
  for (std::size_t i = 0; i < law.ratios.size(); ++i)
    law.ratios[i] = static_cast<float>(c[i + 1] / c[0]);
  return law;
}
std::optional<ExponentialLaw> law_of(const material::Material& material, ExponentialLaw law) {
  if (material.elastic_law != ElasticLaw::Measured ||
      material.measured.energy != material::StrainEnergy::Exponential)
    return {};
  law.exponent = static_cast<float>(material.measured.exponent);
  return law;
}

}  // namespace

Tissue::Tissue(const organ::Organ& organ, StrainScheme scheme)
    : Tissue(topology::Topology(organ), {}, scheme) {}

Tissue::Tissue(const topology::Topology& topology, std::span<const Colour> colours,
               StrainScheme scheme)
    : groups_(topology,
              NodalStrain::are_needed(topology.organ()) && scheme == StrainScheme::Implicit
                  ? Coupling::NodalStrain
                  : Coupling::Elements,
              colours),
      scheme_(scheme) {
  const auto& organ = topology.organ();
  if (NodalStrain::are_needed(organ))
    nodal_strain_ = std::make_unique<NodalStrain>(topology, groups_);
  if (Springs::are_needed(organ)) energies_.push_back(std::make_unique<Springs>(topology, groups_));
  if (has_law(organ, ElasticLaw::TensorMass))
    energies_.push_back(std::make_unique<TensorMass>(topology, groups_));
  if (has_law(organ, ElasticLaw::NeoHookean))
    add_hyperelastic<NeoHookeanLaw>(topology,
                                    hyperelastic_parameters(organ, [](const material::Material& m) {
                                      return m.elastic_law == ElasticLaw::NeoHookean;
                                    }));
  add_measured<ReducedPolynomialLaw>(topology);
  add_measured<ExponentialLaw>(topology);
  if (topology.ties().count() > 0) {
    auto ties = std::make_unique<Ties>(topology, groups_);
    ties_ = ties.get();
    energies_.push_back(std::move(ties));
  }
  add_relaxation(topology);
  resize_stresses();
}

void Tissue::resize_stresses() {
  if (nodal_strain_ && scheme_ == StrainScheme::Explicit)
    nodal_stresses_.resize(NodalStrain::kRows * groups_.slot_count());
}

void Tissue::update_nodal_stress(Group group, const Float4* x) {
  constexpr auto kRows = NodalStrain::kRows;
  const auto f = nodal_strain_->restarted(group, x);
  NodalStress8 stress{{zero_vec8(), zero_vec8(), zero_vec8()}, all(0), all(0)};
  for (const auto& energy : averaged_) energy->add_stress(group, f, stress);
  const std::size_t first = kRows * kLanes * group;
  if (const auto* const relaxation = relaxation_ ? relaxation_->nodal() : nullptr) {
    const Float4* const q = relaxation->relaxed() + first;
    Float8 unused;
    const Vec8 q0 = load_strided(q, kRows, unused), q1 = load_strided(q + 1, kRows, unused),
               q2 = load_strided(q + 2, kRows, unused);
    for (std::size_t r = 0; r < kRows; ++r)
      stress.rows[r] =
          stress.rows[r] - Vec8{dot8(f.rows[r], q0), dot8(f.rows[r], q1), dot8(f.rows[r], q2)};
  }
  for (std::size_t r = 0; r < kRows; ++r)
    store_strided(&nodal_stresses_[first + r], kRows, stress.rows[r],
                  r == 0 ? stress.stiffness : stress.drag);
}

Tissue::NodalForces Tissue::nodal_forces(Group group) const {
  // Sums live in registers, see NodalHyperelastic::add().
  Vec8 gradient = zero_vec8();
  Float8 stiffness = all(0), drag = all(0);
  const Float4* const stresses = nodal_stresses_.data();
  for (const auto& row : nodal_strain_->rows(group)) {
    const Vec8 b = load(row.part);
    const auto add = [&b](const Vec8& p, Float8 sum) {
      return fma8(p.z, b.z, fma8(p.y, b.y, fma8(p.x, b.x, sum)));
    };
    Float8 of_stiffness, of_drag;
    gradient.x = add(gather(stresses, row.domain, of_stiffness), gradient.x);
    gradient.y = add(gather(stresses + 1, row.domain, of_drag), gradient.y);
    gradient.z = add(gather(stresses + 2, row.domain), gradient.z);
    const Float8 squared = dot8(b, b);
    stiffness = fma8(of_stiffness, squared, stiffness);
    drag = fma8(of_drag, squared, drag);
  }
  return {gradient, stiffness, drag};
}

template <typename Law>
void Tissue::add_hyperelastic(const topology::Topology& topology,
                              const HyperelasticParameters& parameters, const Law& law) {
  energies_.push_back(
      std::make_unique<Hyperelastic<Law>>(topology, groups_, nodal_strain_.get(), parameters, law));
  const auto is_averaged = [&](std::size_t i) {
    const auto& material = organ::material_at(topology.organ(), static_cast<std::uint16_t>(i));
    return parameters[i] && material.has_averaged_strain;
  };
  for (std::size_t i = 0; i < parameters.size(); ++i)
    if (is_averaged(i)) {
      averaged_.push_back(std::make_unique<NodalHyperelastic<Law>>(
          topology, groups_, *nodal_strain_, parameters, law));
      return;
    }
}

// One energy for all materials whose laws are multiples of each other.
template <typename Law>
void Tissue::add_measured(const topology::Topology& topology) {
  const auto& organ = topology.organ();
  std::vector<Law> laws;
  for (std::size_t i = 0; i <= organ.regions.size(); ++i) {
    const auto law = law_of(organ::material_at(organ, static_cast<std::uint16_t>(i)), Law{});
    if (law && std::ranges::find(laws, *law) == laws.end()) laws.push_back(*law);
  }
  for (const auto& law : laws)
    add_hyperelastic<Law>(
        topology,
        hyperelastic_parameters(
            organ, [&](const material::Material& m) { return law_of(m, Law{}) == law; }),
        law);
}

void Tissue::add_relaxation(const topology::Topology& topology) {
  if (!Relaxation::is_needed(topology.organ())) return;
  relaxation_ = std::make_unique<Relaxation>(topology, groups_, nodal_strain_.get(), scheme_);
  relaxed_stress_ = std::make_unique<RelaxedStress>(
      topology, groups_, *relaxation_,
      scheme_ == StrainScheme::Implicit ? nodal_strain_.get() : nullptr);
}

void Tissue::touch(Slot slot) {
  auto& lanes = lanes_[slot / kLanes];
  if (lanes == 0) touched_groups_.push_back(slot / kLanes);
  lanes = static_cast<std::uint8_t>(lanes | 1u << slot % kLanes);
}

void Tissue::list_touched(std::vector<GroupLanes>& out) {
  std::ranges::sort(touched_groups_);
  out.clear();
  for (const auto g : touched_groups_) out.push_back({g, lanes_[g]});
}

std::vector<float> Tissue::traces_at_rest(float inverse_dt, bool has_averaged) {
  const std::vector<Float4> rest(groups_.slot_count());
  std::vector<float> traces;
  traces.reserve(rest.size());
  for (Group g = 0; g < groups_.group_count(); ++g) {
    NodeStep8 step{zero_vec8(), zero_sym_mat8()};
    begin_group(g, rest.data(), inverse_dt);
    for (const auto& energy : energies_) energy->add(g, rest.data(), zero_vec8(), step);
    if (has_averaged) add_averaged(g, step);
    Lanes lanes;
    store(lanes, step.block.xx + step.block.yy + step.block.zz);
    traces.insert(traces.end(), std::begin(lanes.v), std::end(lanes.v));
  }
  return traces;
}

UpdateReport Tissue::update_topology(const topology::Topology& topology) {
  changed_.assign(topology.changed().begin(), topology.changed().end());
  std::ranges::sort(changed_);
  groups_.update(topology, changed_);
  lanes_.resize(groups_.group_count());
  const auto touch_node = [&](NodeIndex node) { touch(groups_.slot_of(node)); };
  for (const auto slot : groups_.vacated()) touch(slot);
  for (const auto node : changed_)
    if (topology.has_node(node)) touch_node(node);
  // Rows hold the slots of neighbours.
  for (const auto node : groups_.moved()) {
    touch_node(node);
    topology.for_each_neighbour(node, touch_node);
    topology.ties().for_each_tied(node, touch_node);
  }
  list_touched(touched_);
  wide_.clear();
  if (nodal_strain_) {
    nodal_strain_->update(topology, changed_);
    for (const auto node : changed_) topology.for_each_neighbour(node, touch_node);
    list_touched(wide_);
  }

  UpdateReport report{.nodes_changed = changed_.size(),
                      .nodes_moved = groups_.moved().size(),
                      .groups = touched_groups_.size()};
  for (const auto g : touched_groups_) {
    report.lanes += static_cast<unsigned>(__builtin_popcount(lanes_[g]));
    lanes_[g] = 0;
  }
  touched_groups_.clear();
  resize_stresses();
  const auto lanes = rebuilt();
  if (nodal_strain_) report.rows += nodal_strain_->rebuild(topology, groups_, lanes);
  if (relaxation_) {
    relaxation_->update(topology, groups_, lanes);
    relaxed_stress_->rebuild(topology, groups_, lanes);
  }
  for (const auto& energy : energies_) report.rows += energy->rebuild(topology, groups_, lanes);
  for (const auto& energy : averaged_) energy->rebuild(groups_, lanes);
  return report;
}

void Tissue::begin_group(Group group, const Float4* start, const Vec8& own, float inverse_dt) {
  for (const auto& energy : energies_) energy->begin_group(group, start, own, inverse_dt);
}

void Tissue::pack(const PackedLanes& pack) {
  for (const auto& energy : energies_) energy->pack(pack);
  if (nodal_strain_ && scheme_ == StrainScheme::Implicit) nodal_strain_->pack(pack);
}

double Tissue::energy_j(std::span<const Vec3f> displacements) const {
  std::vector<Vec3d> per_slot(groups_.slot_count());
  std::vector<double> energies(groups_.slot_count());
  for (std::uint32_t n = 0; n < displacements.size(); ++n)
    if (const Slot slot = groups_.slot_of(NodeIndex(n)); slot != kNoSlot)
      per_slot[slot] = to_double(displacements[n]);
  for (const auto& e : energies_) e->add_energies_j(per_slot, energies);
  for (const auto& e : averaged_) e->add_energies_j(per_slot, energies);
  double energy = 0;  // in the order of nodes, whatever their slots
  for (std::uint32_t n = 0; n < displacements.size(); ++n)
    if (const Slot slot = groups_.slot_of(NodeIndex(n)); slot != kNoSlot) energy += energies[slot];
  return energy;
}

}  // namespace trocar::dynamics
