#include "common/scene/organ_file.h"

#include <unistd.h>
#include <zstd.h>

#include <algorithm>
#include <fstream>
#include <memory>

#include "common/base/checksum.h"
#include "proto/organ.pb.h"

namespace trocar::scene {
namespace {

constexpr std::string_view kMagic = "TROCARO1";
constexpr std::uint32_t kVersion = 1;
constexpr std::size_t kHeaderBytes = 24;
constexpr std::uint64_t kMaxBodyBytes = std::uint64_t{512} << 20;
constexpr std::size_t kUnpackStepBytes = std::size_t{1} << 20;
constexpr int kCompressionLevel = 9;

Error bad(const std::string& what) {
  return {ErrorCode::BadFile, what};
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

struct FreeZstd {
  void operator()(ZSTD_DCtx* context) const { ZSTD_freeDCtx(context); }
};

// Grows with what is really there: a short file that announces 512 MiB takes no such memory.
Result<Bytes> unpack(BytesView packed, std::uint64_t announced) {
  const std::unique_ptr<ZSTD_DCtx, FreeZstd> context(ZSTD_createDCtx());
  TROCAR_ASSERT(context != nullptr);
  Bytes body;
  ZSTD_inBuffer in{packed.data(), packed.size(), 0};
  std::size_t wanted = 1;
  while (wanted != 0) {
    const std::size_t before = body.size();
    // One byte more than announced, to notice a body that is longer.
    const auto room = std::min<std::uint64_t>(kUnpackStepBytes, announced + 1 - before);
    if (room == 0) return bad("body is longer than announced");
    body.resize(before + static_cast<std::size_t>(room));
    ZSTD_outBuffer out{body.data() + before, body.size() - before, 0};
    const std::size_t read_before = in.pos;
    wanted = ZSTD_decompressStream(context.get(), &out, &in);
    body.resize(before + out.pos);
    if (ZSTD_isError(wanted)) return bad("body cannot be unpacked, the file is damaged");
    if (out.pos == 0 && in.pos == read_before) return bad("body is cut off");
  }
  if (body.size() != announced) return bad("body has another length than announced");
  if (in.pos != packed.size()) return bad("has bytes behind its body");
  return body;
}

}  // namespace

Bytes encode_organ(const Organ& organ) {
  proto::Organ message;
  message.set_name(organ.name);
  message.set_source(organ.source);
  for (const Vec3d& p : organ.mesh.rest_positions)
    for (const double c : {p.x, p.y, p.z}) message.add_rest_position_m(c);
  put_elements(organ.mesh.tets, message.mutable_tet());
  put_elements(organ.mesh.links, message.mutable_link());
  if (organ.mesh.tets.empty())
    put_elements(organ.mesh.boundary_triangles, message.mutable_boundary_triangle());
  for (const NodeIndex node : organ.fixed_nodes) message.add_fixed_node(node.value);
  for (const double mass : organ.node_masses_kg) message.add_node_mass_kg(mass);
  const Vec3d& offset = organ.source_offset_m;
  for (const double c : {offset.x, offset.y, offset.z}) message.add_source_offset_m(c);
  proto::Material& material = *message.mutable_material();
  material.set_density_kg_m3(organ.material.density_kg_m3);
  material.set_spring_law(static_cast<std::uint32_t>(organ.material.spring_law));
  material.set_spring_stiffness_n_m(organ.material.spring_stiffness_n_m);
  material.set_young_modulus_pa(organ.material.young_modulus_pa);
  material.set_node_damping_per_s(organ.material.node_damping_per_s);
  material.set_spring_damping_time_s(organ.material.spring_damping_time_s);
  Bytes bytes(message.ByteSizeLong());
  TROCAR_ASSERT(message.SerializeToArray(bytes.data(), static_cast<int>(bytes.size())));
  return bytes;
}

Result<Organ> decode_organ(BytesView bytes) {
  proto::Organ message;
  if (bytes.size() > kMaxBodyBytes ||
      !message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())))
    return bad("organ: is not an organ message");
  Organ organ;
  organ.name = message.name();
  organ.source = message.source();
  if (auto s = take_mesh(message, organ.mesh); !s) return bad("organ: " + s.error().message);
  for (const std::uint32_t node : message.fixed_node()) organ.fixed_nodes.emplace_back(node);
  organ.node_masses_kg.assign(message.node_mass_kg().begin(), message.node_mass_kg().end());
  if (message.source_offset_m_size() != 3) return bad("organ: source offset must be three numbers");
  organ.source_offset_m = {message.source_offset_m(0), message.source_offset_m(1),
                           message.source_offset_m(2)};
  if (!message.has_material()) return bad("organ: has no material");
  const proto::Material& material = message.material();
  if (material.spring_law() > static_cast<std::uint32_t>(SpringLaw::VolumeConsistent))
    return bad("organ: unknown spring law " + std::to_string(material.spring_law()));
  organ.material = {material.density_kg_m3(),        static_cast<SpringLaw>(material.spring_law()),
                    material.spring_stiffness_n_m(), material.young_modulus_pa(),
                    material.node_damping_per_s(),   material.spring_damping_time_s()};
  if (auto s = validate(organ); !s) return s.error();
  return organ;
}

Bytes pack_organ(const Organ& organ) {
  const Bytes body = encode_organ(organ);
  TROCAR_ASSERT(body.size() <= kMaxBodyBytes);
  Bytes header;
  ByteWriter writer(header);
  writer.put_bytes(bytes_of(kMagic));
  writer.put(kVersion);
  writer.put(static_cast<std::uint64_t>(body.size()));
  writer.put(crc32(body));
  TROCAR_ASSERT(header.size() == kHeaderBytes);
  Bytes file(kHeaderBytes + ZSTD_compressBound(body.size()));
  std::copy(header.begin(), header.end(), file.begin());
  const std::size_t packed = ZSTD_compress(file.data() + kHeaderBytes, file.size() - kHeaderBytes,
                                           body.data(), body.size(), kCompressionLevel);
  TROCAR_ASSERT(!ZSTD_isError(packed));
  file.resize(kHeaderBytes + packed);
  return file;
}

Result<Organ> unpack_organ(BytesView file) {
  ByteReader reader(file);
  const auto magic = reader.take_bytes(kMagic.size());
  const auto version = reader.take<std::uint32_t>();
  const auto length = reader.take<std::uint64_t>();
  const auto crc = reader.take<std::uint32_t>();
  if (magic.empty() || !std::ranges::equal(magic, bytes_of(kMagic)))
    return bad("is not an .organ file: make one with trocar-organ import");
  if (!reader.ok()) return bad("is cut off in its header");
  if (version != kVersion)
    return bad("has version " + std::to_string(version) + ", this program reads version " +
               std::to_string(kVersion) + ": make or import it again");
  if (length > kMaxBodyBytes) return bad("announces more than 512 MiB");
  const auto body = unpack(file.subspan(kHeaderBytes), length);
  if (!body) return body.error();
  if (crc32(*body) != crc) return bad("is damaged, its checksum does not fit");
  return decode_organ(*body);
}

Status write_organ(const std::filesystem::path& path, const Organ& organ) {
  if (auto s = validate(organ); !s) return s;
  const Bytes file = pack_organ(organ);
  auto temporary = path;
  temporary += "." + std::to_string(::getpid()) + ".tmp";
  std::ofstream out(temporary, std::ios::binary | std::ios::trunc);
  out.write(reinterpret_cast<const char*>(file.data()), static_cast<std::streamsize>(file.size()));
  out.close();
  std::error_code failure;
  if (out) std::filesystem::rename(temporary, path, failure);
  if (out && !failure) return {};
  std::error_code ignored;
  std::filesystem::remove(temporary, ignored);
  return Error{ErrorCode::ResourceMissing,
               path.string() +
                   ": cannot be written: check that the folder exists, may be written "
                   "to and has " +
                   std::to_string((file.size() >> 20) + 1) + " MiB left"};
}

Result<Organ> read_organ(const std::filesystem::path& path) {
  std::error_code failure;
  const auto size = std::filesystem::file_size(path, failure);
  if (failure) return bad(path.string() + ": cannot be opened: " + failure.message());
  if (size > kMaxBodyBytes) return bad(path.string() + ": is larger than 512 MiB");
  Bytes file(static_cast<std::size_t>(size));
  std::ifstream in(path, std::ios::binary);
  in.read(reinterpret_cast<char*>(file.data()), static_cast<std::streamsize>(file.size()));
  if (!in) return bad(path.string() + ": cannot be read");
  auto organ = unpack_organ(file);
  if (!organ) return bad(path.string() + ": " + organ.error().message);
  return organ;
}

}  // namespace trocar::scene
