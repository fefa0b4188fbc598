#include "tests/fuzz/decoders.h"

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <string>
#include <utility>
#include <variant>

#include "common/base/assert.h"
#include "common/image/image.h"
#include "common/journal/session_journal.h"
#include "common/lesson/course.h"
#include "common/secure/datagram_channel.h"
#include "common/secure/join_code.h"
#include "common/tool/instrument.h"
#include "common/tool/script.h"
#include "common/wire/blood_codec.h"
#include "common/wire/fine_surface.h"
#include "common/wire/framing.h"
#include "common/wire/hand_report_messages.h"
#include "common/wire/haptic_messages.h"
#include "common/wire/surface_codec.h"
#include "common/wire/surface_messages.h"
#include "common/wire/surface_slices.h"
#include "common/wire/thread_codec.h"
#include "proto/fine_surface.pb.h"
#include "proto/journal.pb.h"
#include "proto/wire.pb.h"
#include "server/lab/scenario/scenario.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/dicom/dicom_reader.h"
#include "server/organs/embed/embed.h"
#include "server/organs/formats/mesh_file.h"
#include "server/organs/formats/tetgen_reader.h"
#include "server/organs/label_map/label_solid.h"
#include "server/organs/label_map/nifti_reader.h"
#include "server/organs/material/material_file.h"
#include "server/organs/organ/organ_file.h"
#include "server/organs/organ/packed_file.h"
#include "server/organs/surface/closed_surface.h"
#include "server/papers/reduction/reduction_file.h"
#include "server/session/access/code_book.h"
#include "server/session/recording/load_messages.h"
#include "server/session/replication/validation.h"
#include "server/tissue/bleeding/blood.h"
#include "server/tissue/world/surface_layout.h"
#include "server/watch/bus/piece.h"

namespace trocar::fuzz {
namespace {

// An error is one line that says something.
bool checked(const Status& status) {
  if (status.ok()) return true;
  TROCAR_ASSERT(!status.error().message.empty());
  TROCAR_ASSERT(status.error().message.find('\n') == std::string::npos);
  return false;
}
template <typename T>
bool checked(const Result<T>& result) {
  return result.ok() || checked(Status(result.error()));
}

std::string_view text_of(BytesView bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

// A client's hand takes these from a server, and a server the last one from a client; they are
// written and read again alike.
bool decode_haptics(BytesView bytes) {
  proto::Envelope envelope;
  if (!checked(wire::decode_envelope(bytes, envelope))) return false;
  const auto is_read = [](const auto& message) {
    const auto value = wire::read(message);
    if (!checked(value)) return false;
    std::remove_cvref_t<decltype(message)> again;
    wire::write(*value, again);
    TROCAR_ASSERT(wire::read(again).ok());
    return true;
  };
  if (envelope.has_haptic_law()) return is_read(envelope.haptic_law());
  if (envelope.has_hand_report()) return is_read(envelope.hand_report());
  bool are_read = envelope.haptic_patches().patch_size() > 0;
  for (const auto& patch : envelope.haptic_patches().patch()) are_read &= is_read(patch);
  return are_read;
}

// A server takes these from a client.
bool decode_teaching(BytesView bytes) {
  proto::Envelope envelope;
  if (!checked(wire::decode_envelope(bytes, envelope))) return false;
  if (envelope.has_teach_request())
    return checked(replication::check_teach(envelope.teach_request()));
  if (envelope.has_stroke_request())
    return checked(replication::check_stroke(envelope.stroke_request()));
  return envelope.has_view_request() && checked(replication::check_view(envelope.view_request()));
}

bool decode_envelope(BytesView bytes) {
  proto::Envelope envelope;
  return checked(wire::decode_envelope(bytes, envelope));
}

// The first byte chooses between a delta and a keyframe, and how many vertices there are.
bool decode_surface(BytesView bytes) {
  if (bytes.empty()) return false;
  const bool is_keyframe = (bytes[0] & 1) != 0;
  const wire::QuantisedSurface before(1 + std::size_t{2} * bytes[0],
                                      wire::QuantisedVertex{7, 8, 9});
  auto surface = before;
  const auto payload = bytes.subspan(1);
  const bool is_accepted = checked(is_keyframe ? wire::decode_keyframe(payload, surface)
                                               : wire::decode_delta(payload, surface));
  TROCAR_ASSERT(is_accepted || surface == before);
  for (const auto& v : surface)
    TROCAR_ASSERT(std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}) <= wire::kMaxQuanta);
  return is_accepted;
}

// Two numbers of 32 bits say which vertices it is of.
bool decode_surface_slice(BytesView bytes) {
  ByteReader reader(bytes);
  wire::SurfaceSlice slice{reader.read<std::uint32_t>(), reader.read<std::uint32_t>(), {}};
  if (!reader.ok()) return false;
  const auto payload = bytes.subspan(reader.position());
  slice.payload.assign(payload.begin(), payload.end());
  const wire::QuantisedSurface before(700, wire::QuantisedVertex{7, 8, 9});
  auto surface = before;
  const bool is_accepted = checked(wire::decode_slice(slice, surface));
  TROCAR_ASSERT(is_accepted || surface == before);
  return is_accepted;
}

bool decode_blood(BytesView bytes) {
  const wire::BloodLevels before(700, 9);
  auto levels = before;
  const bool is_accepted = checked(wire::decode_blood(bytes, levels));
  TROCAR_ASSERT(is_accepted || levels == before);
  return is_accepted;
}

// A picture that is accepted comes out again as it was.
bool decode_threads(BytesView bytes) {
  const auto picture = wire::decode_threads(bytes);
  if (!picture.ok()) return false;
  Bytes again;
  wire::encode_threads(*picture, again);
  const auto same = wire::decode_threads(again);
  TROCAR_ASSERT(same.ok() && *same == *picture);
  return true;
}

// The blood of a snapshot. A state that is accepted is written as it was read.
bool decode_bleeding(BytesView bytes) {
  bleeding::Blood blood;
  auto reading = world::StateArchive::reading(bytes);
  blood.visit_state(reading);
  if (!reading.ok() || !reading.at_end()) return false;
  Bytes again;
  auto writing = world::StateArchive::writing(again);
  blood.visit_state(writing);
  TROCAR_ASSERT(std::ranges::equal(again, bytes));
  return true;
}

// Datagrams of a handshake, each behind its length of 16 bits: the first byte chooses between those
// that a server gets and those that a client gets. Accepted: one of them was answered.
bool decode_handshake(BytesView bytes) {
  if (bytes.empty()) return false;
  int answers = 0;
  const auto send = [&answers](BytesView) { ++answers; };
  const auto ignore = [](BytesView) {};
  secure::DatagramListener listener([](const auto&) { return std::optional(secure::Digest{}); });
  std::unique_ptr<secure::DatagramChannel> channel;
  const bool is_client = (bytes[0] & 1) != 0;
  if (is_client) {
    channel = secure::DatagramChannel::make_client({}, send);
    channel->start();
    answers = 0;
  }
  ByteReader reader(bytes.subspan(1));
  while (true) {
    const auto datagram = reader.read_bytes(reader.read<std::uint16_t>());
    if (!reader.ok()) break;
    if (channel)
      channel->receive(datagram, ignore);
    else
      channel = listener.receive(datagram, "192.0.2.1 5000", send);
  }
  return answers > 0;
}

// Pieces of a session on a bus, each behind its length of 16 bits. Accepted: they made a whole, and
// what is in it are Envelopes.
bool decode_broadcast(BytesView bytes) {
  bus::Assembler assembler;
  ByteReader reader(bytes);
  while (true) {
    const auto piece = bus::read_piece(reader.read_bytes(reader.read<std::uint16_t>()));
    if (!reader.ok()) return false;
    if (!checked(piece) || piece->pieces == 0) continue;
    const auto whole = assembler.add(*piece);
    if (!checked(whole) || !*whole) continue;
    const auto messages = bus::split_messages(**whole);
    return checked(messages) && std::ranges::all_of(*messages, [](BytesView framed) {
             return decode_envelope(framed.subspan(wire::kHeaderBytes));
           });
  }
}

bool decode_topology(BytesView bytes) {
  proto::SurfaceTopology message;
  return message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())) &&
         checked(wire::read(message));
}

bool decode_fine_surface(BytesView bytes) {
  proto::FineSurface message;
  return message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())) &&
         checked(wire::read(message));
}

// A change of a small block's surface, as a client knows it.
bool decode_change(BytesView bytes) {
  static const wire::SurfaceLayout kBefore = [] {
    auto layout = world::make_surface_layout(*catalogue::make_lattice({6, 4, 6, 0.01}));
    layout.vertex_of_node.clear();
    std::ranges::fill(layout.node_of_vertex, NodeIndex{});
    return layout;
  }();
  proto::SurfaceChange message;
  if (!message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) return false;
  const auto change = wire::read(message, kBefore);
  if (!checked(change)) return false;
  auto layout = kBefore;
  const bool is_accepted = checked(wire::apply(*change, layout));
  TROCAR_ASSERT(is_accepted || layout == kBefore);
  return is_accepted;
}

// Loads on a small block; they are written and read again alike.
Status read_loads(journal::SessionJournal& journal) {
  static const auto kBlock = *catalogue::make_lattice({3, 3, 3, 0.01});
  const auto message = journal.loads();
  if (!message) return message.error();
  if (!*message) return {};
  const auto loads = recording::from_message(**message, kBlock);
  if (!loads) return loads.error();
  proto::ExternalLoads again;
  recording::to_message(*loads, again);
  const auto reread = recording::from_message(again, kBlock);
  TROCAR_ASSERT(reread.ok() && *reread == *loads);
  return {};
}

// A file in memory, for readers that take a path.
class MemoryFile {
 public:
  explicit MemoryFile(BytesView bytes) : file_(memfd_create("fuzz", 0)) {
    TROCAR_ASSERT(file_ >= 0);
    const bool is_written =
        write(file_, bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size());
    TROCAR_ASSERT(is_written);
  }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  ~MemoryFile() { close(file_); }

  std::string path() const { return "/proc/self/fd/" + std::to_string(file_); }

 private:
  int file_;
};

bool decode_journal(BytesView bytes) {
  const MemoryFile file(bytes);
  const auto journal = journal::SessionJournal::open(file.path());
  bool is_accepted = checked(journal);
  if (is_accepted) {
    auto& read = **journal;
    constexpr Tick kLast = ~Tick{0} >> 1;
    const auto all = [](Tick, const auto&) { return true; };
    is_accepted &= checked(read.organ());
    is_accepted &= checked(read_loads(read));
    is_accepted &= checked(read.read_tick_records(0, kLast, all));
    is_accepted &= checked(read.read_surface_deltas(0, kLast, all));
    is_accepted &= checked(read.read_topology_changes(0, kLast, all));
    is_accepted &= checked(read.read_frame_states(0, kLast, all));
    is_accepted &= checked(read.read_claims(0, kLast, all));
    is_accepted &= checked(read.read_snapshots(0, kLast, all));
    is_accepted &= checked(read.surface_key_before(kLast));
    is_accepted &= checked(read.participants_before(kLast));
  }
  return is_accepted;
}

// Bytes without a file's magic are taken for the content of one: no fuzzer guesses a CRC.
template <typename Unpack>
bool decode_packed(BytesView bytes, std::string_view magic, std::uint32_t version,
                   const Unpack& unpack) {
  if (organ::has_magic(bytes, magic)) return checked(unpack(bytes));
  const organ::PackedKind kind{magic, "", "", "", version, version};
  return checked(unpack(organ::pack(kind, version, Bytes(bytes.begin(), bytes.end()))));
}

bool decode_organ(BytesView bytes) {
  return organ::has_magic(bytes, "TROCARO1") ? checked(organ::unpack_organ(bytes))
                                             : checked(organ::decode_organ(bytes));
}
bool decode_reduction(BytesView bytes) {
  return decode_packed(bytes, reduction::kReductionMagic, 1, reduction::unpack_reduction);
}
// The fine surface is valid. The block is large, so that surfaces of all sizes lie near its own.
void embed_surface(const surface::RawSurface& raw, const std::string& name) {
  static const auto kBlock = *catalogue::make_lattice({3, 3, 3, 0.5});
  const auto fine = embed::embed(raw, kBlock.mesh, {.picture = raw.picture, .name = name});
  if (checked(fine)) TROCAR_ASSERT(wire::validate(fine->surface).ok());
}
// Readers of mesh files, and what makes a valid mesh or a closed surface of what they read.
bool make_solid(Result<formats::TetsOrSurface> read, const std::string& name) {
  if (!checked(read)) return false;
  if (auto* raw = std::get_if<surface::RawSurface>(&*read)) {
    embed_surface(*raw, name);
    return checked(surface::check_surface(std::move(*raw), mesh::Unit::Metre, name));
  }
  const auto mesh =
      mesh::make_mesh(std::get<mesh::RawTets>(std::move(*read)), mesh::Unit::Metre, name);
  TROCAR_ASSERT(!mesh.ok() || mesh::validate(mesh->mesh).ok());
  return checked(mesh);
}
template <const char* kName>
bool decode_mesh(BytesView bytes) {
  return make_solid(formats::parse_mesh(text_of(bytes), kName), kName);
}
constexpr char kGmsh[] = "a.msh", kVtk[] = "a.vtk", kVtu[] = "a.vtu", kMedit[] = "a.mesh",
               kAbaqus[] = "a.inp", kStl[] = "a.stl", kObj[] = "a.obj", kPly[] = "a.ply",
               kGlb[] = "a.glb";

// Bytes without a file's magic are taken for its JSON and, behind a zero, its numbers: no fuzzer
// keeps the lengths of both right.
bool decode_glb(BytesView bytes) {
  const auto text = text_of(bytes);
  if (text.starts_with("glTF")) return decode_mesh<kGlb>(bytes);
  const auto split = std::min(text.find('\0'), text.size());
  const auto numbers = text.substr(std::min(split + 1, text.size()));
  Bytes file;
  const auto put = [&file](std::string_view part) {
    const auto view = bytes_of(part);
    file.insert(file.end(), view.begin(), view.end());
  };
  const auto put_number = [&put](std::size_t number) {
    const auto value = static_cast<std::uint32_t>(number);
    put({reinterpret_cast<const char*>(&value), sizeof value});
  };
  put("glTF");
  put_number(2);
  put_number(12 + 8 + split + 8 + numbers.size());
  put_number(split);
  put("JSON");
  put(text.substr(0, split));
  put_number(numbers.size());
  put({"BIN\0", 4});
  put(numbers);
  return decode_mesh<kGlb>(file);
}

bool decode_image(BytesView bytes) {
  const auto image = image::decode(text_of(bytes));
  TROCAR_ASSERT(!image.ok() ||
                image->pixels.size() == std::size_t(image->width) * std::size_t(image->height));
  return checked(image);
}

bool decode_nifti(BytesView bytes) {
  auto map = label_map::parse_nifti(text_of(bytes), std::nullopt, "a.nii");
  return checked(map) && checked(label_map::LabelSolid::make(std::move(*map), {}, "a.nii"));
}

bool decode_dicom(BytesView bytes) {
  const MemoryFile file(bytes);
  return dicom::is_dicom(file.path()) && checked(dicom::read_dicom(file.path()));
}

// A zero stands between the two files.
bool decode_tetgen(BytesView bytes) {
  const auto text = text_of(bytes);
  const auto split = std::min(text.find('\0'), text.size());
  const auto elements = text.substr(std::min(split + 1, text.size()));
  auto tets = formats::parse_tetgen(text.substr(0, split), "a.node", elements, "a.ele");
  if (!checked(tets)) return false;
  return make_solid(formats::TetsOrSurface(std::move(*tets)), "a.ele");
}
bool decode_script(BytesView bytes) {
  return checked(tool::parse_script_text(text_of(bytes), "a.toml"));
}
bool decode_scenario(BytesView bytes) {
  return checked(scenario::parse_scenario_text(text_of(bytes), "a.toml"));
}
bool decode_lesson(BytesView bytes) {
  const auto lesson = lesson::read_lesson_text(text_of(bytes), "a.toml");
  if (!checked(lesson)) return false;
  // A lesson that is accepted can be given.
  lesson::Course course(*lesson);
  std::vector<lesson::Tip> tips{{.tool = ToolSlot{0}, .position_m = {0, 0.1, 0}}};
  for (Tick tick = 16; tick < 160; tick += 16) course.observe({.tick = tick, .tips = tips});
  while (!course.is_over()) course.skip();
  TROCAR_ASSERT(course.points() >= 0 && course.points() <= 100);
  return true;
}
bool decode_instruments(BytesView bytes) {
  return checked(tool::read_instruments_text(text_of(bytes), "a.toml"));
}
bool decode_material(BytesView bytes) {
  return checked(material::parse_material_text(text_of(bytes), "a.toml"));
}

// A code that is read is written and read alike.
bool decode_invitation(BytesView bytes) {
  const auto invitation = secure::parse_invitation(text_of(bytes));
  if (!checked(invitation)) return false;
  const auto again = secure::parse_join_code(secure::to_text(invitation->code));
  TROCAR_ASSERT(again.ok() && *again == invitation->code);
  return true;
}

bool decode_codes(BytesView bytes) {
  return checked(access::parse_codes(std::string(text_of(bytes))));
}

constexpr Decoder kDecoders[] = {
    {"envelope", decode_envelope},
    {"haptics", decode_haptics},
    {"teaching", decode_teaching},
    {"surface_codec", decode_surface},
    {"surface_slice", decode_surface_slice},
    {"blood", decode_blood},
    {"threads", decode_threads},
    {"bleeding", decode_bleeding},
    {"handshake", decode_handshake},
    {"broadcast", decode_broadcast},
    {"surface_topology", decode_topology},
    {"surface_change", decode_change},
    {"fine_surface", decode_fine_surface},
    {"journal", decode_journal},
    {"organ", decode_organ},
    {"reduction", decode_reduction},
    {"gmsh", decode_mesh<kGmsh>},
    {"vtk", decode_mesh<kVtk>},
    {"vtu", decode_mesh<kVtu>},
    {"medit", decode_mesh<kMedit>},
    {"abaqus", decode_mesh<kAbaqus>},
    {"tetgen", decode_tetgen},
    {"stl", decode_mesh<kStl>},
    {"obj", decode_mesh<kObj>},
    {"ply", decode_mesh<kPly>},
    {"glb", decode_glb},
    {"image", decode_image},
    {"nifti", decode_nifti},
    {"dicom", decode_dicom},
    {"script", decode_script},
    {"scenario", decode_scenario},
    {"lesson", decode_lesson},
    {"instruments", decode_instruments},
    {"material", decode_material},
    {"invitation", decode_invitation},
    {"codes", decode_codes},
};

}  // namespace

std::span<const Decoder> decoders() {
  return kDecoders;
}

const Decoder* find_decoder(std::string_view name) {
  const auto at = std::ranges::find(kDecoders, name, &Decoder::name);
  return at == std::end(kDecoders) ? nullptr : at;
}

}  // namespace trocar::fuzz
