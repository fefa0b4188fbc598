#include "server/organs/edit/editor.h"

#include <algorithm>
#include <utility>

#include "common/base/printable.h"
#include "server/organs/material/material_keys.h"
#include "server/organs/organ/any_material.h"
#include "server/organs/organ/average_strain.h"

namespace trocar::edit {
namespace {

constexpr std::size_t kMostSourceBytes = 4000;  // to which something is still added
constexpr const char* kEdited = ", edited";

using Nodes = std::vector<NodeIndex>;

Nodes ascending(std::span<const NodeIndex> nodes, std::size_t node_count) {
  Nodes sorted(nodes.begin(), nodes.end());
  std::erase_if(sorted, [&](NodeIndex node) { return node.value >= node_count; });
  std::sort(sorted.begin(), sorted.end());
  sorted.erase(std::unique(sorted.begin(), sorted.end()), sorted.end());
  return sorted;
}

Nodes united(const Nodes& a, const Nodes& b) {
  Nodes both;
  std::set_union(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(both));
  return both;
}

Nodes without(const Nodes& a, const Nodes& b) {
  Nodes rest;
  std::set_difference(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(rest));
  return rest;
}

// Whether a region of these nodes would have an element.
bool holds_an_element(const mesh::TetMesh& mesh, const Nodes& nodes) {
  std::vector<std::uint8_t> is_inside(mesh.node_count());
  for (const NodeIndex node : nodes) is_inside[node.value] = 1;
  const auto is_in = [&](const auto& element) {
    return std::ranges::all_of(element, [&](NodeIndex n) { return is_inside[n.value] != 0; });
  };
  return mesh.tets.empty() ? std::ranges::any_of(mesh.spring_pairs(), is_in)
                           : std::ranges::any_of(mesh.tets, is_in);
}

bool is_name(const std::string& name) {
  return !name.empty() && name.size() <= organ::kMostNameBytes && is_printable(name);
}

// nodes: ascending.
bool lies_in(const mesh::Tet& tet, const std::vector<NodeIndex>& nodes) {
  return std::ranges::all_of(
      tet, [&](NodeIndex node) { return std::ranges::binary_search(nodes, node); });
}

}  // namespace

Editor::Editor(organ::Organ organ) : organ_(std::move(organ)), first_(content()), saved_(first_) {}

std::size_t Editor::Content::bytes() const {
  std::size_t sum = sizeof *this + source.size() + fixed_nodes.size() * sizeof(NodeIndex) +
                    node_masses_kg.size() * sizeof(double) +
                    depth_table.rows.size() * sizeof(depth_table.rows[0]);
  for (const auto& region : regions)
    sum += sizeof region + region.name.size() + region.nodes.size() * sizeof(NodeIndex) +
           region.tets.size() * sizeof(TetIndex);
  return sum;
}

Editor::Content Editor::content() const {
  return {organ_.source,      organ_.material,       organ_.regions,
          organ_.fixed_nodes, organ_.node_masses_kg, organ_.depth_table};
}

void Editor::set_content(Content content) {
  organ_.source = std::move(content.source);
  organ_.material = std::move(content.material);
  organ_.regions = std::move(content.regions);
  organ_.fixed_nodes = std::move(content.fixed_nodes);
  organ_.node_masses_kg = std::move(content.node_masses_kg);
  organ_.depth_table = std::move(content.depth_table);
  ++version_;
}

template <typename Change>
bool Editor::change(const Change& make) {
  auto before = content();
  const auto weights = organ::mass_weights(organ_);
  make();
  if (content() == before) return false;
  finish(weights);
  future_.clear();
  ++version_;
  if (is_in_stroke_ && std::exchange(is_stroke_remembered_, true)) return true;
  past_.push_back(std::move(before));
  std::size_t bytes = 0;
  for (const auto& step : past_) bytes += step.bytes();
  while (past_.size() > kMostSteps || (bytes > kMostBytes && past_.size() > 1)) {
    bytes -= past_.front().bytes();
    past_.pop_front();
  }
  return true;
}

void Editor::finish(const std::vector<double>& weights_before) {
  organ::follow_weights(organ_, weights_before);
  organ_.depth_table = {};
  if (!organ_.source.ends_with(kEdited) && organ_.source.size() < kMostSourceBytes)
    organ_.source += kEdited;
}

bool Editor::hold(std::span<const NodeIndex> nodes) {
  return change([&] {
    organ_.fixed_nodes = united(organ_.fixed_nodes, ascending(nodes, organ_.mesh.node_count()));
  });
}

bool Editor::release(std::span<const NodeIndex> nodes) {
  return change([&] {
    organ_.fixed_nodes = without(organ_.fixed_nodes, ascending(nodes, organ_.mesh.node_count()));
  });
}

Status Editor::check_name(const std::string& name) const {
  if (!is_name(name))
    return Error{ErrorCode::Usage, "the name of a region must have 1 to " +
                                       std::to_string(organ::kMostNameBytes) +
                                       " bytes of printable UTF-8"};
  if (std::ranges::find(organ_.regions, name, &material::MaterialRegion::name) !=
      organ_.regions.end())
    return Error{ErrorCode::Usage,
                 "region '" + name + "': the organ has one of that name, choose another"};
  return {};
}

Result<std::size_t> Editor::add_region(const std::string& name, std::span<const NodeIndex> nodes) {
  if (auto checked = check_name(name); !checked) return checked.error();
  if (organ_.regions.size() >= organ::kMaxRegions)
    return Error{ErrorCode::Usage, "region '" + name + "': the organ has " +
                                       std::to_string(organ::kMaxRegions) +
                                       " regions, which is the limit"};
  auto own = ascending(nodes, organ_.mesh.node_count());
  if (!holds_an_element(organ_.mesh, own))
    return Error{ErrorCode::Usage, "region '" + name + "': its " + std::to_string(own.size()) +
                                       " nodes hold no whole " +
                                       (organ_.mesh.tets.empty() ? "spring" : "tet") +
                                       ", so nothing would be of it: enlarge it, or paint deeper"};
  change([&] { organ_.regions.push_back({name, organ_.material, std::move(own)}); });
  return organ_.regions.size() - 1;
}

bool Editor::add_to_region(std::size_t region, std::span<const NodeIndex> nodes) {
  if (region >= organ_.regions.size()) return false;
  return change([&] {
    auto& own = organ_.regions[region];
    const auto added = without(ascending(nodes, organ_.mesh.node_count()), own.nodes);
    own.nodes = united(own.nodes, added);
    if (own.tets.empty()) return;
    // Those that the new nodes complete.
    for (std::size_t t = 0; t < organ_.mesh.tets.size(); ++t)
      if (const auto& tet = organ_.mesh.tets[t];
          lies_in(tet, own.nodes) && std::ranges::any_of(tet, [&](NodeIndex node) {
            return std::ranges::binary_search(added, node);
          }))
        own.tets.emplace_back(t);
    std::ranges::sort(own.tets);
  });
}

bool Editor::take_from_region(std::size_t region, std::span<const NodeIndex> nodes) {
  if (region >= organ_.regions.size()) return false;
  const auto& own = organ_.regions[region];
  auto rest = without(own.nodes, ascending(nodes, organ_.mesh.node_count()));
  if (rest.size() == own.nodes.size()) return false;
  auto tets = own.tets;
  std::erase_if(tets, [&](TetIndex t) { return !lies_in(organ_.mesh.tets[t.value], rest); });
  if (own.tets.empty() ? !holds_an_element(organ_.mesh, rest) : tets.empty())
    return remove_region(region);
  return change([&] {
    organ_.regions[region].nodes = std::move(rest);
    organ_.regions[region].tets = std::move(tets);
  });
}

bool Editor::remove_region(std::size_t region) {
  if (region >= organ_.regions.size()) return false;
  return change(
      [&] { organ_.regions.erase(organ_.regions.begin() + static_cast<std::ptrdiff_t>(region)); });
}

Status Editor::rename_region(std::size_t region, const std::string& name) {
  if (region >= organ_.regions.size()) return Error{ErrorCode::Usage, "there is no such region"};
  if (auto checked = check_name(name); !checked) return checked;
  change([&] { organ_.regions[region].name = name; });
  return {};
}

bool Editor::raise_region(std::size_t region) {
  if (region >= organ_.regions.size()) return false;
  return change([&] {
    const auto first = organ_.regions.begin() + static_cast<std::ptrdiff_t>(region);
    std::rotate(first, first + 1, organ_.regions.end());
  });
}

const material::Material* Editor::material_of(Part part) const {
  if (!part) return &organ_.material;
  return *part < organ_.regions.size() ? &organ_.regions[*part].material : nullptr;
}

Status Editor::change_material(Part part, const material::Material& material) {
  organ::Organ changed = organ_;
  (part ? changed.regions[*part].material : changed.material) = material;
  if (organ::any_material(changed, material::is_hyperelastic))
    if (auto averaged = organ::average_strain(changed); !averaged) return averaged;
  if (auto valid = organ::validate(changed); !valid) return valid;
  change([&] {
    organ_.material = std::move(changed.material);
    organ_.regions = std::move(changed.regions);
  });
  return {};
}

Status Editor::use_measured(Part part, const material::HyperelasticMaterial& measured) {
  const auto* before = material_of(part);
  if (before == nullptr) return Error{ErrorCode::Usage, "there is no such region"};
  auto material = *before;
  material::use_measured(measured, material);
  return change_material(part, material);
}

Status Editor::use_neo_hookean(Part part, double young_modulus_pa, double poisson_ratio) {
  const auto* before = material_of(part);
  if (before == nullptr) return Error{ErrorCode::Usage, "there is no such region"};
  auto material = *before;
  material.elastic_law = material::ElasticLaw::NeoHookean;
  material.measured = {};
  material.young_modulus_pa = young_modulus_pa;
  material.poisson_ratio = poisson_ratio;
  return change_material(part, material);
}

void Editor::begin_stroke() {
  is_in_stroke_ = true;
  is_stroke_remembered_ = false;
}

void Editor::end_stroke() {
  is_in_stroke_ = is_stroke_remembered_ = false;
}

bool Editor::undo() {
  end_stroke();
  if (past_.empty()) return false;
  future_.push_back(content());
  set_content(std::move(past_.back()));
  past_.pop_back();
  return true;
}

bool Editor::redo() {
  end_stroke();
  if (future_.empty()) return false;
  past_.push_back(content());
  set_content(std::move(future_.back()));
  future_.pop_back();
  return true;
}

std::vector<std::size_t> Editor::element_counts() const {
  std::vector<std::size_t> counts(organ_.regions.size() + 1);
  const auto map = organ::material_map(organ_);
  for (const auto part : organ_.mesh.tets.empty() ? map.spring_pairs : map.tets) ++counts[part];
  return counts;
}

std::vector<std::string> Editor::remarks() const {
  std::vector<std::string> remarks;
  if (organ_.fixed_nodes.empty())
    remarks.emplace_back("Nothing holds this organ: a push moves all of it.");
  if (organ_.fixed_nodes.size() == organ_.mesh.node_count())
    remarks.emplace_back("All nodes are held: nothing can move.");
  const bool is_another = first_.fixed_nodes != organ_.fixed_nodes ||
                          first_.material != organ_.material || first_.regions != organ_.regions;
  if (!organ_.stress_free_positions_m.empty() && is_another)
    remarks.emplace_back(
        "It was settled as it was before: settle it again, or it sags when a session starts.");
  if (!first_.depth_table.rows.empty() && organ_.depth_table.rows.empty())
    remarks.emplace_back("Its calibration was of the organ before: calibrate it again.");
  const auto counts = element_counts();
  for (std::size_t r = 0; r < organ_.regions.size(); ++r)
    if (counts[r + 1] == 0)
      remarks.push_back("Region " + organ_.regions[r].name +
                        " has no element: later ones cover it, or it is too thin.");
  return remarks;
}

}  // namespace trocar::edit
