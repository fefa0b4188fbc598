#include "server/organs/organ/organ_file.h"

#include <algorithm>

#include "common/budget/message_budget.h"
#include "proto/organ.pb.h"
#include "server/organs/organ/bad_file.h"
#include "server/organs/organ/packed_file.h"

namespace trocar::organ {
namespace {

// An organ with directions of fibres, with regions that say their tets, or with ties, is of a
// version that programs which would ignore them refuse.
constexpr std::uint32_t kOrganVersion = 5, kVersionWithoutTies = 4, kVersionWithoutTets = 3,
                        kVersionWithoutFibres = 2;
constexpr PackedKind kOrganKind{"TROCARO1",
                                "an .organ file",
                                "make one with trocar-organ import",
                                "make or import it again",
                                kVersionWithoutFibres,
                                kOrganVersion};

std::uint32_t version_of(const Organ& organ) {
  const auto says_tets = [](const auto& region) { return !region.tets.empty(); };
  if (!organ.ties.empty()) return kOrganVersion;
  return std::ranges::any_of(organ.regions, says_tets) ? kVersionWithoutTies
         : organ.fibre_directions.empty()              ? kVersionWithoutFibres
                                                       : kVersionWithoutTets;
}

template <typename Field, std::size_t kNodes>
void put_elements(const std::vector<std::array<NodeIndex, kNodes>>& elements, Field* field) {
  field->Reserve(static_cast<int>(elements.size() * kNodes));
  for (const auto& element : elements)
    for (const NodeIndex node : element) field->Add(node.value);
}

template <std::size_t kNodes, typename Field>
Status take_elements(const char* what, const Field& field, std::size_t node_count,
                     std::vector<std::array<NodeIndex, kNodes>>& elements) {
  const auto count = static_cast<std::size_t>(field.size());
  if (count % kNodes != 0)
    return bad(std::string(what) + " list has " + std::to_string(count) +
               " numbers, must be a multiple of " + std::to_string(kNodes));
  elements.resize(count / kNodes);
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t node = field.Get(static_cast<int>(i));
    if (node >= node_count)
      return bad(std::string(what) + " " + std::to_string(i / kNodes) + " refers to node " +
                 std::to_string(node) + " of " + std::to_string(node_count));
    elements[i / kNodes][i % kNodes] = NodeIndex(node);
  }
  return {};
}

using Numbers = google::protobuf::RepeatedField<double>;

void put_vector(const Vec3d& v, Numbers* field) {
  for (const double c : {v.x, v.y, v.z}) field->Add(c);
}
Vec3d vector_at(const Numbers& field, int first) {
  return {field.Get(first), field.Get(first + 1), field.Get(first + 2)};
}

Status take_vectors(const char* what, const Numbers& field, std::vector<Vec3d>& out) {
  if (field.size() % 3 != 0)
    return bad("organ: " + std::string(what) + " must be three numbers a node");
  for (int i = 0; i < field.size(); i += 3) out.push_back(vector_at(field, i));
  return {};
}

void put_measured(const material::HyperelasticMaterial& m, proto::MeasuredMaterial& out) {
  out.set_name(m.name);
  out.set_source(m.source);
  for (const double c : m.coefficients_pa) out.add_coefficient_pa(c);
  out.set_bulk_modulus_pa(m.bulk_modulus_pa);
  if (m.energy == material::StrainEnergy::Exponential) out.set_exponent(m.exponent);
  for (const auto& [weight, time_s] : m.relaxation) {
    out.add_relaxation(weight);
    out.add_relaxation(time_s);
  }
}

void put_material(const material::Material& m, proto::Material& out) {
  out.set_density_kg_m3(m.density_kg_m3);
  out.set_spring_law(static_cast<std::uint32_t>(m.spring_law));
  out.set_spring_stiffness_n_m(m.spring_stiffness_n_m);
  out.set_young_modulus_pa(m.young_modulus_pa);
  out.set_node_damping_per_s(m.node_damping_per_s);
  out.set_edge_damping_time_s(m.edge_damping_time_s);
  out.set_elastic_law(static_cast<std::uint32_t>(m.elastic_law));
  out.set_poisson_ratio(m.poisson_ratio);
  out.set_has_averaged_strain(m.has_averaged_strain);
  if (length(m.fibre_direction) > 0) put_vector(m.fibre_direction, out.mutable_fibre_direction());
  out.set_fibre_stiffness_ratio(m.fibre_stiffness_ratio);
  out.set_tension(m.tension);
  out.set_fibre_tension(m.fibre_tension);
  out.set_cut_energy_j_m2(m.cut_energy_j_m2);
  out.set_tear_stretch(m.tear_stretch);
  out.set_blade_friction_pa(m.blade_friction_pa);
  if (m.elastic_law == material::ElasticLaw::Measured)
    put_measured(m.measured, *out.mutable_measured());
}

Status take_measured(const proto::MeasuredMaterial& in, material::HyperelasticMaterial& m) {
  const auto coefficients = static_cast<std::size_t>(in.coefficient_pa_size());
  if (coefficients == 0 || coefficients > material::kMaxPolynomialOrder)
    return bad("organ: a measured material has " + std::to_string(coefficients) +
               " coefficients, must have 1 to " + std::to_string(material::kMaxPolynomialOrder));
  if (in.relaxation_size() % 2 != 0 ||
      in.relaxation_size() > 2 * static_cast<int>(material::kMaxPronyTerms))
    return bad("organ: relaxation of a measured material must be two numbers a term, at most " +
               std::to_string(material::kMaxPronyTerms) + " terms");
  m = {.name = in.name(), .source = in.source(), .bulk_modulus_pa = in.bulk_modulus_pa()};
  std::ranges::copy(in.coefficient_pa(), m.coefficients_pa.begin());
  if (in.has_exponent()) {
    m.energy = material::StrainEnergy::Exponential;
    m.exponent = in.exponent();
  }
  for (int i = 0; i < in.relaxation_size(); i += 2)
    m.relaxation.push_back({in.relaxation(i), in.relaxation(i + 1)});
  return {};
}

Status take_material(const proto::Material& in, material::Material& m) {
  if (in.spring_law() > static_cast<std::uint32_t>(material::SpringLaw::VolumeConsistent))
    return bad("organ: unknown spring law " + std::to_string(in.spring_law()));
  if (in.elastic_law() > static_cast<std::uint32_t>(material::ElasticLaw::Measured))
    return bad("organ: unknown elastic law " + std::to_string(in.elastic_law()));
  if (in.fibre_direction_size() != 0 && in.fibre_direction_size() != 3)
    return bad("organ: fibre direction must be three numbers");
  m = {.density_kg_m3 = in.density_kg_m3(),
       .spring_law = static_cast<material::SpringLaw>(in.spring_law()),
       .spring_stiffness_n_m = in.spring_stiffness_n_m(),
       .young_modulus_pa = in.young_modulus_pa(),
       .node_damping_per_s = in.node_damping_per_s(),
       .edge_damping_time_s = in.edge_damping_time_s(),
       .elastic_law = static_cast<material::ElasticLaw>(in.elastic_law()),
       .poisson_ratio = in.poisson_ratio(),
       .measured = {},
       .has_averaged_strain = in.has_averaged_strain(),
       .fibre_direction = {},
       .fibre_stiffness_ratio = in.fibre_stiffness_ratio(),
       .tension = in.tension(),
       .fibre_tension = in.fibre_tension(),
       .tear_stretch = in.tear_stretch()};
  if (in.has_cut_energy_j_m2()) m.cut_energy_j_m2 = in.cut_energy_j_m2();
  if (in.has_blade_friction_pa()) m.blade_friction_pa = in.blade_friction_pa();
  if (m.elastic_law == material::ElasticLaw::Measured)
    if (auto s = take_measured(in.measured(), m.measured); !s) return s;
  if (in.fibre_direction_size() == 3) m.fibre_direction = vector_at(in.fibre_direction(), 0);
  return {};
}

void put_ties(const TieBand& band, proto::TieBand& out) {
  out.set_name(band.name);
  out.set_strength_pa(band.law.strength_pa);
  out.set_toughness_j_m2(band.law.toughness_j_m2);
  out.set_rise_m(band.law.rise_m);
  for (const auto& tie : band.ties) {
    for (const auto& end : tie.ends) {
      out.add_triangle(end.triangle.value);
      for (const double weight : end.weights) out.add_weight(weight);
    }
    out.add_area_m2(tie.area_m2);
  }
}

Status take_ties(const proto::TieBand& in, TieBand& band) {
  band.name = in.name();
  band.law = {in.strength_pa(), in.toughness_j_m2(), in.rise_m()};
  const int count = in.area_m2_size();
  if (in.triangle_size() != 2 * count || in.weight_size() != 6 * count)
    return bad("organ: ties must have two triangles and six weights each");
  for (int i = 0; i < count; ++i) {
    auto& tie = band.ties.emplace_back();
    tie.area_m2 = in.area_m2(i);
    for (int e = 0; e < 2; ++e) {
      auto& end = tie.ends[static_cast<std::size_t>(e)];
      end.triangle = TriangleIndex(in.triangle(2 * i + e));
      for (int k = 0; k < 3; ++k)
        end.weights[static_cast<std::size_t>(k)] = in.weight(6 * i + 3 * e + k);
    }
  }
  return {};
}

void put_depth_table(const DepthTable& table, proto::DepthTable& out) {
  out.set_error(table.error);
  out.set_tool_radius_m(table.tool_radius_m);
  out.set_places(table.places);
  for (const auto& row : table.rows) {
    auto& entry = *out.add_row();
    entry.set_force_n(row.force_n);
    if (row.frozen_nodes) entry.set_frozen_nodes(*row.frozen_nodes);
    if (row.graded_depth) entry.set_graded_depth(*row.graded_depth);
    entry.set_frozen_error(row.frozen_error);
    entry.set_graded_error(row.graded_error);
  }
}

DepthTable take_depth_table(const proto::DepthTable& in) {
  DepthTable table{in.error(), in.tool_radius_m(), in.places(), {}};
  for (const auto& entry : in.row()) {
    auto& row = table.rows.emplace_back();
    row.force_n = entry.force_n();
    if (entry.has_frozen_nodes()) row.frozen_nodes = entry.frozen_nodes();
    if (entry.has_graded_depth()) row.graded_depth = entry.graded_depth();
    row.frozen_error = entry.frozen_error();
    row.graded_error = entry.graded_error();
  }
  return table;
}

Status take_mesh(const proto::Organ& message, mesh::TetMesh& mesh) {
  const auto& positions = message.rest_position_m();
  if (positions.empty() || positions.size() % 3 != 0)
    return bad("rest positions: " + std::to_string(positions.size()) +
               " numbers, must be three per node");
  for (int i = 0; i < positions.size(); i += 3)
    mesh.rest_positions.push_back({positions[i], positions[i + 1], positions[i + 2]});
  const auto count = mesh.node_count();
  if (auto s = take_elements<4>("tet", message.tet(), count, mesh.tets); !s) return s;
  if (auto s = take_elements<2>("link", message.link(), count, mesh.links); !s) return s;
  if (auto s = take_elements<3>("boundary triangle", message.boundary_triangle(), count,
                                mesh.boundary_triangles);
      !s)
    return s;
  if (!mesh.tets.empty() && !mesh.boundary_triangles.empty())
    return bad("boundary triangles are given although there are tets");
  mesh.build_adjacency();
  return {};
}

}  // namespace

Bytes encode_organ(const Organ& organ) {
  proto::Organ message;
  message.set_name(organ.name);
  message.set_source(organ.source);
  for (const Vec3d& p : organ.mesh.rest_positions) put_vector(p, message.mutable_rest_position_m());
  put_elements(organ.mesh.tets, message.mutable_tet());
  put_elements(organ.mesh.links, message.mutable_link());
  if (organ.mesh.tets.empty())
    put_elements(organ.mesh.boundary_triangles, message.mutable_boundary_triangle());
  for (const NodeIndex node : organ.fixed_nodes) message.add_fixed_node(node.value);
  for (const double mass : organ.node_masses_kg) message.add_node_mass_kg(mass);
  put_vector(organ.source_offset_m, message.mutable_source_offset_m());
  put_material(organ.material, *message.mutable_material());
  for (const auto& region : organ.regions) {
    auto& entry = *message.add_region();
    entry.set_name(region.name);
    put_material(region.material, *entry.mutable_material());
    for (const NodeIndex node : region.nodes) entry.add_node(node.value);
    for (const TetIndex tet : region.tets) entry.add_tet(tet.value);
    if (!region.look.empty()) entry.set_look(region.look);
  }
  if (length(organ.gravity_m_s2) > 0)
    put_vector(organ.gravity_m_s2, message.mutable_gravity_m_s2());
  for (const Vec3d& p : organ.stress_free_positions_m)
    put_vector(p, message.mutable_stress_free_position_m());
  for (const Vec3d& f : organ.fibre_directions) put_vector(f, message.mutable_fibre_direction());
  for (const auto& band : organ.ties) put_ties(band, *message.add_tie_band());
  if (!organ.depth_table.empty())
    put_depth_table(organ.depth_table, *message.mutable_depth_table());
  if (!organ.fine_surface.empty()) wire::write(organ.fine_surface, *message.mutable_fine_surface());
  Bytes bytes(message.ByteSizeLong());
  TROCAR_ASSERT(message.SerializeToArray(bytes.data(), static_cast<int>(bytes.size())));
  return bytes;
}

namespace {

// file_bytes: as many came from outside, packed or not.
Result<Organ> decode_within(BytesView bytes, std::size_t file_bytes) {
  proto::Organ message;
  if (bytes.size() > kMaxPackedBodyBytes) return bad("organ: is larger than 512 MiB");
  if (auto s = check_budget(*proto::Organ::descriptor(), bytes, build_budget(file_bytes)); !s)
    return bad("organ: " + s.error().message);
  if (!message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())))
    return bad("organ: is not an organ message");
  Organ organ;
  organ.name = message.name();
  organ.source = message.source();
  if (auto s = take_mesh(message, organ.mesh); !s) return bad("organ: " + s.error().message);
  for (const std::uint32_t node : message.fixed_node()) organ.fixed_nodes.emplace_back(node);
  organ.node_masses_kg.assign(message.node_mass_kg().begin(), message.node_mass_kg().end());
  if (message.source_offset_m_size() != 3) return bad("organ: source offset must be three numbers");
  organ.source_offset_m = vector_at(message.source_offset_m(), 0);
  if (!message.has_material()) return bad("organ: has no material");
  if (auto s = take_material(message.material(), organ.material); !s) return s.error();
  for (const auto& entry : message.region()) {
    auto& region = organ.regions.emplace_back();
    region.name = entry.name();
    if (auto s = take_material(entry.material(), region.material); !s) return s.error();
    for (const std::uint32_t node : entry.node()) region.nodes.emplace_back(node);
    for (const std::uint32_t tet : entry.tet()) region.tets.emplace_back(tet);
    region.look = entry.look();
  }
  if (message.gravity_m_s2_size() != 0 && message.gravity_m_s2_size() != 3)
    return bad("organ: gravity must be three numbers");
  if (message.gravity_m_s2_size() == 3) organ.gravity_m_s2 = vector_at(message.gravity_m_s2(), 0);
  if (auto s = take_vectors("stress-free positions", message.stress_free_position_m(),
                            organ.stress_free_positions_m);
      !s)
    return s.error();
  if (auto s =
          take_vectors("directions of fibres", message.fibre_direction(), organ.fibre_directions);
      !s)
    return s.error();
  for (const auto& band : message.tie_band())
    if (auto s = take_ties(band, organ.ties.emplace_back()); !s) return s.error();
  if (message.has_depth_table()) organ.depth_table = take_depth_table(message.depth_table());
  if (message.has_fine_surface()) {
    auto fine = wire::read(message.fine_surface());
    if (!fine) return bad("organ: " + fine.error().message);
    organ.fine_surface = std::move(*fine);
  }
  if (auto s = validate(organ); !s) return s.error();
  return organ;
}

}  // namespace

Result<Organ> decode_organ(BytesView bytes) {
  return decode_within(bytes, bytes.size());
}

Bytes pack_organ(const Organ& organ) {
  return pack(kOrganKind, version_of(organ), encode_organ(organ));
}

Result<Organ> unpack_organ(BytesView file) {
  const auto unpacked = unpack(kOrganKind, file);
  if (!unpacked) return unpacked.error();
  auto organ = decode_within(unpacked->body, file.size());
  if (organ.ok() && version_of(*organ) != unpacked->version)
    return bad("says version " + std::to_string(unpacked->version) + ", but holds version " +
               std::to_string(version_of(*organ)) + ": it is damaged");
  return organ;
}

Status check_organ_name(const std::filesystem::path& path) {
  if (path.extension() == ".organ") return {};
  return Error{ErrorCode::Usage, path.string() + ": the file's name must end with .organ"};
}

Status write_organ(const std::filesystem::path& path, const Organ& organ) {
  if (auto s = check_organ_name(path); !s) return s;
  if (auto s = validate(organ); !s) return s;
  return write_packed(path, pack_organ(organ));
}

Result<Organ> read_organ(const std::filesystem::path& path) {
  const auto file = read_packed(path);
  if (!file) return file.error();
  auto organ = unpack_organ(*file);
  if (!organ) return bad(path.string() + ": " + organ.error().message);
  return organ;
}

}  // namespace trocar::organ
