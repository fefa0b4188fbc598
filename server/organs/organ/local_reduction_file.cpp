#include "server/organs/organ/local_reduction_file.h"

#include <algorithm>
#include <cstring>

#include "proto/local_reduction.pb.h"
#include "server/organs/organ/bad_file.h"

namespace trocar::organ {
namespace {

constexpr std::uint32_t kVersion = 2;
constexpr PackedKind kKind{kLocalReductionMagic,
                           "a .reduction file",
                           "make one with trocar-organ reduce --method local",
                           "make it again with trocar-organ reduce --method local",
                           kVersion,
                           kVersion};

using Numbers = google::protobuf::RepeatedField<double>;
using Indices = google::protobuf::RepeatedField<std::uint32_t>;

void put(const PackedField& field, proto::PackedField& out) {
  const auto bytes = bytes_of(field.values);
  out.set_step(field.step);
  out.set_value(bytes.data(), bytes.size());
}
Status take(const proto::PackedField& in, PackedField& field) {
  const auto& bytes = in.value();
  if (bytes.size() % sizeof(std::int16_t) != 0)
    return bad("has a field of " + std::to_string(bytes.size()) + " bytes, must be two per number");
  field.step = in.step();
  field.values.resize(bytes.size() / sizeof(std::int16_t));
  if (!bytes.empty()) std::memcpy(field.values.data(), bytes.data(), bytes.size());
  return {};
}

template <typename Index>
void put(const std::vector<Index>& indices, Indices* out) {
  for (const auto index : indices) out->Add(index.value);
}
template <typename Index>
void take(const Indices& in, std::vector<Index>& indices) {
  for (const auto value : in) indices.push_back(Index(value));
}

void put(const LocalPatch& patch, proto::LocalPatch& out) {
  out.set_centre(patch.centre.value);
  put(patch.members, out.mutable_member());
  put(patch.reach, out.mutable_reach());
  for (const auto& mode : patch.modes) put(mode, *out.add_mode());
  put(patch.inner_tets, out.mutable_inner_tet());
  for (const auto& [tet, weight] : patch.cubature) {
    out.add_cubature_tet(tet.value);
    out.add_cubature_weight(weight);
  }
  out.mutable_outer_stiffness()->Add(patch.outer_stiffness.begin(), patch.outer_stiffness.end());
  out.mutable_mass()->Add(patch.mass.begin(), patch.mass.end());
}

Status take(const proto::LocalPatch& in, LocalPatch& patch) {
  patch.centre = NodeIndex(in.centre());
  take(in.member(), patch.members);
  take(in.reach(), patch.reach);
  for (const auto& mode : in.mode())
    if (auto s = take(mode, patch.modes.emplace_back()); !s) return s;
  take(in.inner_tet(), patch.inner_tets);
  if (in.cubature_tet_size() != in.cubature_weight_size())
    return bad("has a patch of " + std::to_string(in.cubature_tet_size()) +
               " tets of cubature with " + std::to_string(in.cubature_weight_size()) +
               " weights, must be one each");
  for (int i = 0; i < in.cubature_tet_size(); ++i)
    patch.cubature.push_back({TetIndex(in.cubature_tet(i)), in.cubature_weight(i)});
  patch.outer_stiffness = {in.outer_stiffness().begin(), in.outer_stiffness().end()};
  patch.mass = {in.mass().begin(), in.mass().end()};
  return {};
}

void put(const LocalReduction& r, proto::LocalReduction& message) {
  message.set_source(r.source);
  message.set_mesh_hash(r.mesh_hash);
  message.set_elasticity_hash(r.elasticity_hash);
  message.set_node_count(r.node_count);
  message.set_force_n(r.force_n);
  message.set_free_layers(r.free_layers);
  if (r.force_error) message.set_force_error(*r.force_error);
  for (const auto& [node, fields] : r.greens) {
    auto& entry = *message.add_greens();
    entry.set_node(node.value);
    put(fields[0], *entry.mutable_x());
    put(fields[1], *entry.mutable_y());
    put(fields[2], *entry.mutable_z());
  }
  for (const auto& patch : r.patches) put(patch, *message.add_patch());
  for (const auto& vibration : r.vibrations) put(vibration, *message.add_vibration());
}

Result<LocalReduction> decode(BytesView bytes) {
  proto::LocalReduction message;
  if (!message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())))
    return bad("is not a local reduction message");
  LocalReduction r;
  r.source = message.source();
  r.mesh_hash = message.mesh_hash();
  r.elasticity_hash = message.elasticity_hash();
  r.node_count = message.node_count();
  r.force_n = message.force_n();
  r.free_layers = message.free_layers();
  if (message.has_force_error()) r.force_error = message.force_error();
  for (const auto& entry : message.greens()) {
    auto& greens = r.greens.emplace_back();
    greens.node = NodeIndex(entry.node());
    if (auto s = take(entry.x(), greens.fields[0]); !s) return s.error();
    if (auto s = take(entry.y(), greens.fields[1]); !s) return s.error();
    if (auto s = take(entry.z(), greens.fields[2]); !s) return s.error();
  }
  for (const auto& vibration : message.vibration())
    if (auto s = take(vibration, r.vibrations.emplace_back()); !s) return s.error();
  for (const auto& entry : message.patch())
    if (auto s = take(entry, r.patches.emplace_back()); !s) return s.error();
  if (auto s = validate(r); !s) return s.error();
  return r;
}

// Rounded up.
std::uint64_t mebibytes(std::uint64_t bytes) {
  constexpr std::uint64_t kMebibyte = std::uint64_t{1} << 20;
  return (bytes + kMebibyte - 1) / kMebibyte;
}

}  // namespace

Result<Bytes> pack_local_reduction(const LocalReduction& reduction, std::uint64_t max_body_bytes) {
  proto::LocalReduction message;
  put(reduction, message);
  const std::uint64_t size = message.ByteSizeLong();
  if (size > max_body_bytes)
    return bad("the reduction takes " + std::to_string(mebibytes(size)) + " MiB, a file at most " +
               std::to_string(mebibytes(max_body_bytes)) +
               " MiB: make it with fewer modes or larger patches");
  Bytes body(static_cast<std::size_t>(size));
  TROCAR_ASSERT(message.SerializeToArray(body.data(), static_cast<int>(body.size())));
  return pack(kKind, kVersion, body);
}

Result<LocalReduction> unpack_local_reduction(BytesView file) {
  if (has_magic(file, kDoganReductionMagic))
    return bad(
        "is a reduction by --method dogan, which sessions cannot use: make one with trocar-organ "
        "reduce --method local");
  const auto unpacked = unpack(kKind, file);
  if (!unpacked) return unpacked.error();
  return decode(unpacked->body);
}

Status write_local_reduction(const std::filesystem::path& path, const LocalReduction& reduction) {
  if (auto s = validate(reduction); !s) return s;
  const auto file = pack_local_reduction(reduction);
  if (!file) return Error{file.error().code, path.string() + ": " + file.error().message};
  return write_packed(path, *file);
}

Result<LocalReduction> read_local_reduction(const std::filesystem::path& path, const Organ& organ) {
  const auto file = read_packed(path);
  if (!file) return file.error();
  auto reduction = unpack_local_reduction(*file);
  if (reduction.ok())
    if (auto s = check_organ(*reduction, organ); !s) reduction = s.error();
  if (!reduction)
    return Error{reduction.error().code, path.string() + ": " + reduction.error().message};
  return reduction;
}

Result<LocalReduction> read_session_reduction(const std::filesystem::path& path,
                                              const Organ& organ) {
  // First: otherwise what its hash covers is only "another material".
  if (auto s = check_reducible(organ); !s) return s.error();
  auto reduction = read_local_reduction(path, organ);
  if (reduction.ok())
    if (auto s = check_masses(*reduction, organ); !s)
      reduction = Error{s.error().code, path.string() + ": " + s.error().message};
  return reduction;
}

}  // namespace trocar::organ
