#include "server/papers/reduction/reduction_file.h"

#include "proto/reduction.pb.h"
#include "server/organs/organ/packed_file.h"

namespace trocar::reduction {
namespace {

constexpr std::uint32_t kVersion = 1;
constexpr organ::PackedKind kKind{kReductionMagic,
                                  "a .reduction file",
                                  "make one with trocar-organ reduce",
                                  "make it again with trocar-organ reduce",
                                  kVersion,
                                  kVersion};

using Numbers = google::protobuf::RepeatedField<double>;

void put(const std::vector<double>& values, Numbers* field) {
  field->Add(values.begin(), values.end());
}
std::vector<double> taken(const Numbers& field) {
  return {field.begin(), field.end()};
}

Bytes encode(const Reduction& r) {
  proto::Reduction message;
  message.set_method(r.method);
  message.set_source(r.source);
  message.set_mesh_hash(r.mesh_hash);
  message.set_elasticity_hash(r.elasticity_hash);
  message.set_node_count(r.node_count);
  message.set_snapshot_count(r.snapshot_count);
  message.set_force_n(r.force_n);
  message.set_radius_m(r.radius_m);
  put(r.eigenvalues_m2, message.mutable_eigenvalue_m2());
  message.set_eigenvalue_sum_m2(r.eigenvalue_sum_m2);
  put(r.modes, message.mutable_mode());
  put(r.initial_tangent_n_m, message.mutable_initial_tangent_n_m());
  put(r.best_tangent_n_m, message.mutable_best_tangent_n_m());
  message.set_influence_m(r.influence_m);
  put(r.creep_times_s, message.mutable_creep_time_s());
  for (const auto& curve : r.creep) {
    auto& entry = *message.add_creep();
    entry.set_node(curve.node.value);
    put(curve.overall_growth, entry.mutable_overall_growth());
    for (const auto& [node, growth] : curve.neighbours) {
      auto& neighbour = *entry.add_neighbour();
      neighbour.set_node(node.value);
      put(growth, neighbour.mutable_growth());
    }
  }
  Bytes bytes(message.ByteSizeLong());
  TROCAR_ASSERT(message.SerializeToArray(bytes.data(), static_cast<int>(bytes.size())));
  return bytes;
}

Result<Reduction> decode(BytesView bytes) {
  proto::Reduction message;
  if (!message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())))
    return Error{ErrorCode::BadFile, "is not a reduction message"};
  Reduction r;
  r.method = message.method();
  r.source = message.source();
  r.mesh_hash = message.mesh_hash();
  r.elasticity_hash = message.elasticity_hash();
  r.node_count = message.node_count();
  r.snapshot_count = message.snapshot_count();
  r.force_n = message.force_n();
  r.radius_m = message.radius_m();
  r.eigenvalues_m2 = taken(message.eigenvalue_m2());
  r.eigenvalue_sum_m2 = message.eigenvalue_sum_m2();
  r.modes = taken(message.mode());
  r.initial_tangent_n_m = taken(message.initial_tangent_n_m());
  r.best_tangent_n_m = taken(message.best_tangent_n_m());
  r.influence_m = message.influence_m();
  r.creep_times_s = taken(message.creep_time_s());
  for (const auto& entry : message.creep()) {
    auto& curve = r.creep.emplace_back();
    curve.node = NodeIndex(entry.node());
    curve.overall_growth = taken(entry.overall_growth());
    for (const auto& neighbour : entry.neighbour())
      curve.neighbours.push_back({NodeIndex(neighbour.node()), taken(neighbour.growth())});
  }
  if (auto s = validate(r); !s) return s.error();
  return r;
}

}  // namespace

Bytes pack_reduction(const Reduction& reduction) {
  return organ::pack(kKind, kVersion, encode(reduction));
}

Result<Reduction> unpack_reduction(BytesView file) {
  const auto unpacked = organ::unpack(kKind, file);
  if (!unpacked) return unpacked.error();
  return decode(unpacked->body);
}

Status write_reduction(const std::filesystem::path& path, const Reduction& reduction) {
  if (auto s = validate(reduction); !s) return s;
  return organ::write_packed(path, pack_reduction(reduction));
}

Result<Reduction> read_reduction(const std::filesystem::path& path, const organ::Organ& organ) {
  const auto file = organ::read_packed(path);
  if (!file) return file.error();
  auto reduction = unpack_reduction(*file);
  if (reduction.ok())
    if (auto s = check_organ(*reduction, organ); !s) reduction = s.error();
  if (!reduction)
    return Error{reduction.error().code, path.string() + ": " + reduction.error().message};
  return reduction;
}

}  // namespace trocar::reduction
