// write_seeds DIR: the seeds that are not text, one file per decoder, made from small sound data.
// Run after a change of a format:
//   ninja -C build/release write_seeds && build/release/bin/write_seeds tests/fuzz/seeds

#include <cstdio>
#include <filesystem>
#include <fstream>

#include "common/secure/datagram_channel.h"
#include "common/wire/blood_codec.h"
#include "common/wire/fine_surface.h"
#include "common/wire/hand_report_messages.h"
#include "common/wire/haptic_messages.h"
#include "common/wire/surface_messages.h"
#include "common/wire/surface_slices.h"
#include "common/wire/thread_codec.h"
#include "proto/fine_surface.pb.h"
#include "proto/wire.pb.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/organ/organ_file.h"
#include "server/papers/reduction/reduction_file.h"
#include "server/tissue/bleeding/blood.h"
#include "server/tissue/world/surface_layout.h"
#include "server/watch/bus/piece.h"
#include "tests/dicom/dicom_sample.h"
#include "tests/journal/session_samples.h"
#include "tests/papers/synthetic_reduction.h"
#include "tests/support/surface_edits.h"

namespace {

using namespace trocar;  // NOLINT: a program's own file
namespace fs = std::filesystem;

fs::path root;

void save(const char* decoder, const char* name, BytesView bytes) {
  fs::create_directories(root / decoder);
  std::ofstream file(root / decoder / name, std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
  std::printf("%s/%s: %zu bytes\n", decoder, name, bytes.size());
}
void save(const char* decoder, const char* name, const google::protobuf::Message& message) {
  save(decoder, name, bytes_of(std::string_view(message.SerializeAsString())));
}

void save_surfaces() {
  for (const bool is_keyframe : {false, true}) {
    // decoders.cpp reads it so: the first byte is the count of vertices and the kind.
    Bytes bytes{static_cast<std::uint8_t>(is_keyframe ? 101 : 100)};
    const wire::QuantisedSurface before(1 + 2 * bytes[0], wire::QuantisedVertex{7, 8, 9});
    auto after = before;
    for (std::size_t i = 0; i < after.size(); i += 3)
      after[i].x += static_cast<std::int32_t>(i) - 90;
    if (is_keyframe)
      wire::encode_keyframe(after, bytes);
    else
      wire::encode_delta(before, after, bytes);
    save("surface_codec", is_keyframe ? "keyframe" : "delta", bytes);
  }
  const auto layout = world::make_surface_layout(*catalogue::make_lattice({6, 4, 6, 0.01}));
  proto::SurfaceTopology topology;
  wire::write(layout, "box", topology);
  save("surface_topology", "box", topology);
  const auto& first = layout.triangles.front();
  auto change = trocar::testing::split_edge(layout, first[0], first[1], 1);
  auto after = layout;
  TROCAR_ASSERT(wire::apply(change, after).ok());
  proto::SurfaceChange message;
  wire::write(change, after, message);
  save("surface_change", "split_edge", message);
  wire::FineSurface fine;
  for (const std::int32_t q : {0, 20'000, 40'000}) {
    fine.quanta.push_back({q, q * q % 997, 0});
    fine.texture.push_back({q / 2, q % 999});
  }
  fine.triangles.push_back({0, 1, 2});
  fine.picture = "\x89PNG\r\n\x1a\n";
  proto::FineSurface fine_message;
  wire::write(fine, fine_message);
  save("fine_surface", "painted_triangle", fine_message);
}

void save_dicom() {
  fs::create_directories(root / "dicom");
  for (const bool is_slice : {false, true}) {
    DcmFileFormat file;
    if (is_slice)
      dicom::testing::make_slice(*file.getDataset(), 2);
    else
      dicom::testing::make_segmentation(*file.getDataset());
    const auto path = root / "dicom" / (is_slice ? "slice" : "segmentation");
    TROCAR_ASSERT(file.saveFile(path.c_str(), EXS_LittleEndianExplicit).good());
    std::printf("%s\n", path.c_str());
  }
}

void save_slices() {
  const wire::QuantisedSurface before(700, wire::QuantisedVertex{7, 8, 9});
  auto after = before;
  for (std::size_t i = 0; i < after.size(); i += 2)
    after[i] += {static_cast<std::int32_t>(i * i % 900), -static_cast<std::int32_t>(i), 4};
  const auto slices = wire::encode_slices(before, after, 500);
  Bytes bytes;
  ByteWriter writer(bytes);
  writer.put(slices.back().first_vertex);
  writer.put(slices.back().vertices);
  bytes.insert(bytes.end(), slices.back().payload.begin(), slices.back().payload.end());
  save("surface_slice", "last", bytes);
}

void save_blood() {
  wire::BloodLevels levels(700);
  for (std::size_t i = 100; i < 300; i += 3) levels[i] = static_cast<std::uint8_t>(i);
  Bytes payload;
  wire::encode_blood({}, levels, payload);
  save("blood", "film", payload);
  bleeding::Blood blood;
  blood.resize(20);
  blood.volume_pl[3] = 700, blood.open[3] = 5, blood.was_wound[3] = 1, blood.levels[3] = 2;
  blood.shed_pl = 1000, blood.dripped_pl = 200, blood.sucked_pl = 100;
  blood.clip_vessel = {0}, blood.clip_place_m = {{0.1, 0.2, 0.3}}, blood.clip_reach_m = {0.01};
  Bytes state;
  auto archive = world::StateArchive::writing(state);
  StateHasher hasher;
  blood.update_hash(hasher);
  blood.visit_state(archive);
  save("bleeding", "clipped", state);
}

void save_threads() {
  wire::ThreadPicture picture{
      .threads = {{.nodes = 40, .material = 2}, {.nodes = 4, .material = 0}},
      .pegs = {{.from = {-900, 0, 0}, .to = {900, 0, 0}, .radius = 90}},
      .places = {},
      .is_joined = {}};
  for (std::int32_t i = 0; i < 44; ++i) picture.places.push_back({31 * i, i * i / 4, -i});
  picture.is_joined.assign(44, 1);
  picture.is_joined[17] = picture.is_joined[39] = picture.is_joined[43] = 0;
  Bytes payload;
  wire::encode_threads(picture, payload);
  save("threads", "cut", payload);
}

void save_datagram(const char* name, bool is_client, BytesView datagram) {
  Bytes bytes{static_cast<std::uint8_t>(is_client)};
  ByteWriter(bytes).put(static_cast<std::uint16_t>(datagram.size()));
  bytes.insert(bytes.end(), datagram.begin(), datagram.end());
  save("handshake", name, bytes);
}

void save_handshakes() {
  secure::DatagramListener listener([](const auto&) { return std::optional(secure::Digest{}); });
  const auto client = secure::DatagramChannel::make_client({}, [&](BytesView hello) {
    save_datagram("hello", false, hello);
    listener.receive(hello, "192.0.2.1 5000",
                     [](BytesView cookie) { save_datagram("cookie", true, cookie); });
  });
  client->start();
}

void save_broadcast() {
  proto::Envelope welcome, ping;
  welcome.mutable_welcome()->set_organ_hash(42);
  ping.mutable_ping()->set_client_time_us(7);
  Bytes whole = *wire::encode_envelope(welcome), bytes;
  const auto second = wire::encode_envelope(ping);
  whole.insert(whole.end(), second->begin(), second->end());
  ByteWriter writer(bytes);
  for (const auto& piece : bus::cut(5, 1, whole, bus::kPieceHeaderBytes + 10)) {
    writer.put(static_cast<std::uint16_t>(piece.size()));
    writer.put_bytes(piece);
  }
  save("broadcast", "pieces", bytes);
}

void save_envelopes() {
  proto::Envelope hello;
  hello.mutable_hello()->set_name("Ada");
  save("envelope", "hello", hello);
  proto::Envelope sample;
  sample.mutable_tool_sample()->set_sequence(1);
  save("envelope", "tool_sample", sample);
  proto::Envelope datagram;
  *datagram.mutable_client_datagram()->add_sample() = sample.tool_sample();
  datagram.mutable_client_datagram()->mutable_ack()->set_frame(3);
  save("envelope", "client_datagram", datagram);
}

void save_teaching() {
  proto::Envelope note;
  note.mutable_teach_request()->set_action(proto::TEACH_NOTE);
  note.mutable_teach_request()->set_text("Look at this later.");
  save("teaching", "note", note);
  proto::Envelope rename;
  auto& order = *rename.mutable_teach_request();
  order.set_action(proto::TEACH_RENAME);
  order.set_participant(2);
  order.set_name("Ada");
  order.set_text("Ada B");
  save("teaching", "rename", rename);
  proto::Envelope stroke;
  for (const std::uint32_t triangle : {5u, 6u}) {
    stroke.mutable_stroke_request()->add_triangle(triangle);
    for (const float weight : {0.25f, 0.5f}) stroke.mutable_stroke_request()->add_weight(weight);
  }
  save("teaching", "stroke", stroke);
  proto::Envelope view;
  view.mutable_view_request()->mutable_eye_m()->set_z(0.4f);
  view.mutable_view_request()->mutable_target_m()->set_y(0.02f);
  save("teaching", "view", view);
}

void save_haptics() {
  proto::Envelope law;
  wire::HapticLaw liver;
  liver.relaxation[0] = {0.5f, 0.6f};
  liver.fast[0] = {1.2f, 0.002f};
  wire::write(liver, *law.mutable_haptic_law());
  save("haptics", "law", law);
  proto::Envelope patches;
  wire::HapticPatch patch;
  for (const auto kind : {wire::TouchKind::Free, wire::TouchKind::Grip}) {
    patch.kind = kind;
    patch.echo_time_us = 1'000'000;
    patch.has_stiffness = true;
    wire::write(patch, *patches.mutable_haptic_patches()->add_patch());
  }
  save("haptics", "patches", patches);
  proto::Envelope report;
  wire::HandReport felt;
  for (std::uint64_t i = 1; i <= 3; ++i)
    felt.moments.push_back({.time_us = 16'000 * i, .hand_force_n = {0, 0.5f, 0}});
  wire::write(felt, *report.mutable_hand_report());
  save("haptics", "hand_report", report);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fputs("write_seeds: usage: write_seeds DIR\n", stderr);
    return 2;
  }
  root = argv[1];
  save_surfaces();
  save_envelopes();
  save_broadcast();
  save_haptics();
  save_teaching();
  save_slices();
  save_blood();
  save_threads();
  save_handshakes();
  save_dicom();
  const auto block = reduction::testing::block(3, 3, 3);
  save("organ", "block", organ::encode_organ(block));
  save("organ", "block.organ", organ::pack_organ(block));
  save("reduction", "synthetic.reduction",
       reduction::pack_reduction(reduction::testing::synthetic_reduction(block, 3)));
  const auto path = fs::temp_directory_path() / "trocar-seed.mcap";
  fs::remove(path);
  {
    journal::testing::SampleSession session(path.string(), 800);
    session.run(4);
    TROCAR_ASSERT(session.writer().close().ok());
  }
  std::ifstream file(path, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  save("journal", "sample", bytes_of(std::string_view(text)));
}
