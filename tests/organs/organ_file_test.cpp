#include "server/organs/organ/organ_file.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <functional>

#include "common/base/checksum.h"
#include "proto/organ.pb.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/catalogue/load_organ.h"
#include "server/organs/organ/packed_file.h"
#include "tests/support/files.h"
#include "tests/support/shared.h"

namespace trocar::organ {
namespace {

Organ small_liver() {
  auto organ = catalogue::make_liver(500);
  TROCAR_ASSERT(organ.ok());
  return std::move(*organ);
}

std::filesystem::path scratch_folder() {
  const auto folder =
      std::filesystem::temp_directory_path() / ("trocar_scene_" + std::to_string(::getpid()));
  std::filesystem::create_directories(folder);
  return folder;
}

Organ measured_organ(material::StrainEnergy energy) {
  auto material = *material::find_measured_material("human_liver_nava2008");
  material.energy = energy;
  if (energy == material::StrainEnergy::Exponential) material.exponent = 2.5;
  auto organ = small_liver();
  material::use_measured(material, organ.material);
  return organ;
}

TEST(OrganFile, RoundTripKeepsEverything) {
  for (const Organ& organ :
       {small_liver(), *catalogue::make_lattice(catalogue::LatticeSize{5, 4, 3, 0.02}),
        measured_organ(material::StrainEnergy::ReducedPolynomial),
        measured_organ(material::StrainEnergy::Exponential)}) {
    const auto decoded = decode_organ(encode_organ(organ));
    ASSERT_TRUE(decoded.ok()) << decoded.error().message;
    EXPECT_EQ(*decoded, organ);
    EXPECT_EQ(organ_hash(*decoded), organ_hash(organ));
    const auto unpacked = unpack_organ(pack_organ(organ));
    ASSERT_TRUE(unpacked.ok()) << unpacked.error().message;
    EXPECT_EQ(*unpacked, organ);
  }
}

Organ organ_with_fibres() {
  Organ organ = small_liver();
  organ.material.fibre_tension = 0.05;
  organ.material.blade_friction_pa = 700;
  organ.regions = {{"part", organ.material, {NodeIndex(1u), NodeIndex(2u)}}};
  for (std::size_t n = 0; n < organ.mesh.node_count(); ++n)
    organ.fibre_directions.push_back(n % 5 == 0 ? Vec3d{} : Vec3d{0, 0.6, n % 2 == 0 ? 0.8 : -0.8});
  return organ;
}

TEST(OrganFile, LawsOfMeasuredMaterialsAreOthers) {
  EXPECT_NE(organ_hash(measured_organ(material::StrainEnergy::ReducedPolynomial)),
            organ_hash(measured_organ(material::StrainEnergy::Exponential)));
}

TEST(OrganFile, KeepsDirectionsOfFibres) {
  const Organ organ = organ_with_fibres();
  const Bytes file = pack_organ(organ);
  const auto unpacked = unpack_organ(file);
  ASSERT_TRUE(unpacked.ok()) << unpacked.error().message;
  EXPECT_EQ(*unpacked, organ);
  Organ without = organ;
  without.fibre_directions.clear();
  EXPECT_NE(organ_hash(organ), organ_hash(without));
  Organ turned = organ;
  turned.fibre_directions[1] = {1, 0, 0};
  EXPECT_NE(organ_hash(organ), organ_hash(turned));
  // Programs that know no directions refuse the one file and read the other.
  EXPECT_EQ(file[8], 3);
  EXPECT_EQ(pack_organ(without)[8], 2);
}

TEST(OrganFile, WrongDirectionsOfFibresAreNamed) {
  const auto message_for = [](auto&& damage) {
    Organ organ = organ_with_fibres();
    damage(organ.fibre_directions);
    const auto decoded = decode_organ(encode_organ(organ));
    return decoded.ok() ? std::string() : decoded.error().message;
  };
  const auto expect = [](const std::string& message, const char* what) {
    EXPECT_NE(message.find(what), std::string::npos) << message;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  };
  expect(message_for([](auto& f) { f.pop_back(); }), "directions of fibres for");
  expect(message_for([](auto& f) { f[3] = {0, 2, 0}; }), "node 3 is neither of length 1 nor zero");
  expect(message_for([](auto& f) { f[4].x = std::nan(""); }), "node 4 is neither");
  expect(message_for([](auto& f) { f[6] = {INFINITY, 0, 0}; }), "node 6 is neither");
  proto::Organ message;
  const Bytes bytes = encode_organ(organ_with_fibres());
  ASSERT_TRUE(message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())));
  message.mutable_fibre_direction()->RemoveLast();
  const std::string text = message.SerializeAsString();
  const auto decoded = decode_organ(bytes_of(std::span(text.data(), text.size())));
  ASSERT_FALSE(decoded.ok());
  expect(decoded.error().message, "three numbers a node");
}

TEST(OrganFile, WithoutBladeFrictionHasTheUsualOne) {
  proto::Organ message;
  const Organ organ = small_liver();
  const Bytes bytes = encode_organ(organ);
  ASSERT_TRUE(message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())));
  message.mutable_material()->clear_blade_friction_pa();
  const std::string text = message.SerializeAsString();
  const auto decoded = decode_organ(bytes_of(std::span(text.data(), text.size())));
  ASSERT_TRUE(decoded.ok());
  EXPECT_EQ(*decoded, organ);
}

TEST(OrganFile, WritesAndReadsAFile) {
  const auto path = scratch_folder() / "liver.organ";
  const Organ organ = small_liver();
  ASSERT_TRUE(write_organ(path, organ));
  const auto read = catalogue::load_organ(path.string());
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(*read, organ);
  // Only the file itself is left.
  std::size_t files = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(scratch_folder()))
    ++files;
  EXPECT_EQ(files, 1u);
  std::filesystem::remove_all(scratch_folder());
}

TEST(OrganFile, FailsToWriteWithAReason) {
  const Status status = write_organ("/nonexistent/folder/a.organ", small_liver());
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::ResourceMissing);
  Organ organ = small_liver();
  organ.node_masses_kg.pop_back();
  EXPECT_FALSE(write_organ(scratch_folder() / "bad.organ", organ).ok());
  EXPECT_FALSE(std::filesystem::exists(scratch_folder() / "bad.organ"));
  std::filesystem::remove_all(scratch_folder());
}

TEST(OrganFile, EveryTruncationIsAnError) {
  const Bytes file = pack_organ(*catalogue::make_lattice(catalogue::LatticeSize{3, 3, 3, 0.02}));
  for (std::size_t n = 0; n < file.size(); ++n)
    ASSERT_FALSE(unpack_organ(BytesView(file).first(n)).ok()) << n;
  Bytes longer = file;
  longer.push_back(0);
  EXPECT_FALSE(unpack_organ(longer).ok());
}

TEST(OrganFile, EveryFlippedByteIsAnError) {
  const Organ organ = *catalogue::make_lattice(catalogue::LatticeSize{3, 3, 3, 0.02});
  const Bytes file = pack_organ(organ);
  for (std::size_t at = 0; at < file.size(); ++at) {
    for (const int bit : {0, 3, 7}) {
      Bytes damaged = file;
      damaged[at] ^= static_cast<std::uint8_t>(1 << bit);
      const auto result = unpack_organ(damaged);
      // A few bits of a zstd header mean nothing; then the content must be the same.
      if (result.ok()) {
        EXPECT_EQ(*result, organ) << at;
      }
    }
  }
}

TEST(OrganFile, DamagedMessagesGiveAValidOrganOrAnError) {
  const Bytes message =
      encode_organ(*catalogue::make_lattice(catalogue::LatticeSize{3, 2, 2, 0.02}));
  for (std::size_t n = 0; n < message.size(); ++n)
    static_cast<void>(decode_organ(BytesView(message).first(n)).ok());
  std::uint32_t state = 3;
  const auto random = [&](std::uint32_t below) {
    state = state * 1664525u + 1013904223u;
    return (state >> 8) % below;
  };
  int rejected = 0;
  for (int i = 0; i < 5000; ++i) {
    Bytes damaged = message;
    for (std::uint32_t k = 1 + random(3); k > 0; --k)
      damaged[random(static_cast<std::uint32_t>(damaged.size()))] =
          static_cast<std::uint8_t>(random(256));
    const auto result = decode_organ(damaged);
    if (result.ok()) {
      EXPECT_TRUE(validate(*result));
    } else {
      ++rejected;
    }
  }
  EXPECT_GT(rejected, 1000);
}

std::string refusal(const std::function<void(proto::Organ&)>& change, const Organ& organ) {
  const Bytes bytes = encode_organ(organ);
  proto::Organ message;
  TROCAR_ASSERT(message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())));
  change(message);
  const std::string text = message.SerializeAsString();
  const auto result = decode_organ(bytes_of(text));
  return result.ok() ? "accepted" : result.error().message;
}

TEST(OrganFile, EachFieldIsChecked) {
  const Organ liver = small_liver(),
              lattice = *catalogue::make_lattice(catalogue::LatticeSize{3, 3, 3, 0.02});
  const auto expect = [&](const char* part, const Organ& organ,
                          const std::function<void(proto::Organ&)>& change) {
    const std::string text = refusal(change, organ);
    EXPECT_NE(text.find(part), std::string::npos) << part << " / " << text;
  };
  expect("three per node", liver, [](auto& m) { m.add_rest_position_m(0); });
  expect("three per node", liver, [](auto& m) { m.clear_rest_position_m(); });
  expect("not finite", liver, [](auto& m) { m.set_rest_position_m(4, NAN); });
  expect("multiple of 4", liver, [](auto& m) { m.add_tet(0); });
  expect("refers to node 4294967295", liver, [](auto& m) { m.set_tet(0, 0xffffffffu); });
  expect("multiple of 2", lattice, [](auto& m) { m.add_link(0); });
  expect("link 0 refers to node 27", lattice, [](auto& m) { m.set_link(1, 27); });
  expect("boundary triangle 0 refers", lattice, [](auto& m) { m.set_boundary_triangle(0, 99); });
  expect("surface is", lattice, [](auto& m) {
    for (int i = 0; i < 3; ++i) m.mutable_boundary_triangle()->RemoveLast();
  });
  expect("although there are tets", liver, [](auto& m) {
    for (const std::uint32_t i : {0u, 1u, 2u}) m.add_boundary_triangle(i);
  });
  expect("fixed node", liver, [](auto& m) { m.add_fixed_node(1u << 30); });
  expect("node masses for", liver, [](auto& m) { m.add_node_mass_kg(1); });
  expect("mass of node 0", liver, [](auto& m) { m.set_node_mass_kg(0, -1); });
  expect("three numbers", liver, [](auto& m) { m.add_source_offset_m(1); });
  expect("no material", liver, [](auto& m) { m.clear_material(); });
  expect("spring law 2", liver, [](auto& m) { m.mutable_material()->set_spring_law(2); });
  expect("spring law 256", liver, [](auto& m) { m.mutable_material()->set_spring_law(256); });
  expect("density", liver, [](auto& m) { m.mutable_material()->set_density_kg_m3(0); });
  expect("1 to 4096 bytes", liver, [](auto& m) { m.clear_name(); });
  expect("control characters", liver, [](auto& m) { m.set_name("a\x1b[31m"); });
}

TEST(OrganFile, AnnouncedLengthsTakeNoMemory) {
  Bytes file = pack_organ(*catalogue::make_lattice(catalogue::LatticeSize{3, 3, 3, 0.02}));
  const auto announce = [&](std::uint64_t bytes) { std::memcpy(&file[12], &bytes, sizeof bytes); };
  rusage before{}, after{};
  getrusage(RUSAGE_SELF, &before);
  announce(std::uint64_t{512} << 20);
  EXPECT_FALSE(unpack_organ(file).ok());
  getrusage(RUSAGE_SELF, &after);
  EXPECT_LT(after.ru_maxrss - before.ru_maxrss, 16 * 1024) << "KiB";
  announce((std::uint64_t{512} << 20) + 1);
  EXPECT_NE(unpack_organ(file).error().message.find("512 MiB"), std::string::npos);
  announce(10);
  EXPECT_FALSE(unpack_organ(file).ok());
}

// Few bytes that stand for much: packed lists of zeros, empty messages, fields of no meaning.
TEST(OrganFile, SmallFilesBuildLittle) {
  constexpr PackedKind kKind{"TROCARO1", "an .organ file", "", "", 2, 4};
  // Numbers of fields, as bytes before a length: 4 is the tets, 11 a region, 14 and 4 a row, 100 is
  // none.
  const auto repeated = [](std::string_view one, std::size_t count) {
    Bytes bytes;
    for (std::size_t i = 0; i < count; ++i) bytes.insert(bytes.end(), one.begin(), one.end());
    return bytes;
  };
  Bytes zeros{0x22, 0x80, 0x80, 0x80, 0x1e};  // 60 MiB of tets
  zeros.resize(zeros.size() + (std::size_t{60} << 20));
  rusage before{}, after{};
  getrusage(RUSAGE_SELF, &before);
  const auto file = pack(kKind, 2, zeros);
  zeros = {};
  EXPECT_LT(file.size(), 16u << 10);
  const auto result = unpack_organ(file);
  ASSERT_FALSE(result.ok());
  EXPECT_NE(result.error().message.find("16 times its size"), std::string::npos)
      << result.error().message;
  for (const auto& body : {repeated(std::string_view("\x5a\0", 2), 4'000'000),
                           repeated(std::string_view("\x72\x02\x22\0", 4), 2'000'000),
                           repeated(std::string_view("\xa2\x06\0", 3), 3'000'000)}) {
    const auto small = unpack_organ(pack(kKind, 2, body));
    ASSERT_FALSE(small.ok());
    EXPECT_NE(small.error().message.find("16 times its size"), std::string::npos)
        << small.error().message;
    // The same without packing counts against its own size.
    EXPECT_FALSE(decode_organ(body).ok());
  }
  getrusage(RUSAGE_SELF, &after);
  // The test's own body of 60 MiB is the most.
  EXPECT_LT(after.ru_maxrss - before.ru_maxrss, 400 * 1024) << "KiB";
}

TEST(OrganFile, OtherVersionsAreNamed) {
  Bytes file = pack_organ(*catalogue::make_lattice(catalogue::LatticeSize{3, 3, 3, 0.02}));
  file[8] = 3;  // of organs with directions of fibres
  EXPECT_NE(unpack_organ(file).error().message.find("version 3"), std::string::npos);
  file[8] = 4;
  EXPECT_NE(unpack_organ(file).error().message.find("version 4"), std::string::npos);
}

TEST(FixRule, ParsesAndRefuses) {
  EXPECT_EQ(parse_fix_rule("none")->side, FixRule::Side::None);
  EXPECT_EQ(*parse_fix_rule("bottom:0.2"), FixRule{});
  EXPECT_EQ(parse_fix_rule("top:1")->side, FixRule::Side::Top);
  EXPECT_EQ(to_text(*parse_fix_rule("back:0.05")), "back:0.05");
  for (const char* text : {"", "bottom", "bottom:", "bottom:0", "bottom:1.1", "bottom:nan",
                           "bottom:0.2x", "left:0.2", "bottom:-0.1", ":0.2", "None"})
    EXPECT_FALSE(parse_fix_rule(text).ok()) << text;
}

TEST(FixRule, HoldsTheSurfaceOfOneSide) {
  const Organ organ = small_liver();
  const auto& mesh = organ.mesh;
  double low = 0, back = 0;
  for (const Vec3d& p : mesh.rest_positions) low = std::min(low, p.y), back = std::min(back, p.z);
  const auto bottom = nodes_held_by({FixRule::Side::Bottom, 0.25}, mesh);
  const auto top = nodes_held_by({FixRule::Side::Top, 0.25}, mesh);
  const auto behind = nodes_held_by({FixRule::Side::Back, 0.25}, mesh);
  for (const NodeIndex node : mesh.surface_nodes) {
    const Vec3d& p = mesh.rest_positions[node.value];
    EXPECT_EQ(std::ranges::binary_search(bottom, node), p.y <= low / 2) << node.value;
    EXPECT_EQ(std::ranges::binary_search(top, node), p.y >= -low / 2) << node.value;
    EXPECT_EQ(std::ranges::binary_search(behind, node), p.z <= back / 2) << node.value;
  }
  EXPECT_EQ(nodes_held_by({FixRule::Side::Bottom, 1}, mesh), mesh.surface_nodes);
  EXPECT_TRUE(nodes_held_by({FixRule::Side::None, 0}, mesh).empty());
}

TEST(LoadOrgan, KnowsTheBuiltInOnesAndRefusesTheRest) {
  EXPECT_EQ(catalogue::load_organ("liver")->name, "liver");
  EXPECT_EQ(catalogue::load_organ("lattice")->name, "lattice");
  EXPECT_EQ(catalogue::load_organ("plate")->name, "plate");
  EXPECT_EQ(catalogue::load_organ("stomach")->name, "stomach");
  for (const char* spec : {"", "kidney", "/nonexistent.organ", "/nonexistent.msh", "/etc/passwd"}) {
    const auto organ = catalogue::load_organ(spec);
    ASSERT_FALSE(organ.ok()) << spec;
    EXPECT_EQ(organ.error().code, ErrorCode::BadFile);
  }
}

TEST(LoadOrgan, ImportsAMesh) {
  TROCAR_SKIP_WITHOUT_SHARED("organs/liver_coarse.msh");
  const auto path = trocar::testing::shared_folder() / "organs/liver_coarse.msh";
  const auto organ = catalogue::load_organ(path.string());
  ASSERT_TRUE(organ.ok()) << organ.error().message;
  EXPECT_EQ(organ->name, "liver_coarse");
  EXPECT_EQ(organ->mesh.node_count(), 3796u);
  EXPECT_EQ(organ->fixed_nodes, nodes_held_by(FixRule{}, organ->mesh));
  EXPECT_GT(organ->fixed_nodes.size(), 100u);
  catalogue::ImportOptions options;
  options.fix.side = FixRule::Side::None;
  options.name = "other\n";
  const auto imported = catalogue::import_organ(path, options);
  ASSERT_TRUE(imported.ok());
  EXPECT_EQ(imported->organ.name, "other_");
  EXPECT_TRUE(imported->organ.fixed_nodes.empty());
}

// All nodes of the middle tet are in the region behind it: by its nodes it would be lost.
TEST(LoadOrgan, ARegionOfElementsKeepsThoseWhoseNodesAreAllInAnother) {
  const trocar::testing::TemporaryFolder folder;
  const auto path = folder.file("thin.msh");
  std::ofstream(path) << "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"
                         "$PhysicalNames\n2\n3 1 \"lumen\"\n3 2 \"wall\"\n$EndPhysicalNames\n"
                         "$Nodes\n6\n1 0 0 0\n2 0.1 0 0\n3 0 0.1 0\n4 0 0 0.1\n5 0 0 -0.1\n"
                         "6 0.1 0.1 0.1\n$EndNodes\n$Elements\n3\n1 4 2 1 1 1 2 3 4\n"
                         "2 4 2 2 1 1 3 2 5\n3 4 2 2 1 2 3 4 6\n$EndElements\n";
  auto organ = catalogue::import_organ(path, {})->organ;
  ASSERT_EQ(organ.regions.size(), 2u);
  EXPECT_EQ(organ.regions[0].tets, std::vector{TetIndex(0)});
  EXPECT_EQ(material_map(organ).tets, (std::vector<std::uint16_t>{1, 2, 2}));

  const auto again = unpack_organ(pack_organ(organ));
  ASSERT_TRUE(again.ok()) << again.error().message;
  EXPECT_EQ(*again, organ);
  const auto hash = organ_hash(organ);
  organ.regions[0].tets = organ.regions[1].tets = {};
  EXPECT_EQ(material_map(organ).tets, (std::vector<std::uint16_t>{2, 2, 2}));
  EXPECT_NE(organ_hash(organ), hash);
  organ.regions[0].tets = {TetIndex(1)};
  EXPECT_NE(validate(organ).error().message.find("tets of region 'lumen'"), std::string::npos);
}

// Without names, groups of lines and of triangles have the same numbers.
TEST(LoadOrgan, SetsAndRegionsOfOneNameGetDistinctNames) {
  const trocar::testing::TemporaryFolder folder;
  const auto path = folder.file("two.msh");
  std::ofstream(path) << "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"
                         "$PhysicalNames\n2\n3 1 \"part\"\n3 2 \"part\"\n$EndPhysicalNames\n"
                         "$Nodes\n5\n1 0 0 0\n2 0.1 0 0\n3 0 0.1 0\n4 0 0 0.1\n5 0 0 -0.1\n"
                         "$EndNodes\n$Elements\n4\n1 1 2 1 1 1 2\n2 2 2 1 1 2 3 4\n"
                         "3 4 2 1 1 1 2 3 4\n4 4 2 2 1 1 3 2 5\n$EndElements\n";
  catalogue::ImportOptions options;
  options.fix_set = "1-2";
  const auto imported = catalogue::import_organ(path, options);
  ASSERT_TRUE(imported.ok()) << imported.error().message;
  EXPECT_EQ(imported->organ.fixed_nodes.size(), 3u);  // the triangle's
  ASSERT_EQ(imported->organ.regions.size(), 2u);
  EXPECT_EQ(imported->organ.regions[0].name, "part");
  EXPECT_EQ(imported->organ.regions[1].name, "part-2");
  EXPECT_EQ(imported->warnings, (std::vector<std::string>{
                                    "regions share a name, so the next 'part' is 'part-2' here",
                                    "sets of nodes share a name, so the next '1' is '1-2' here"}));
  options.fix_set = "1";
  EXPECT_EQ(catalogue::import_organ(path, options)->organ.fixed_nodes.size(), 2u);
}

}  // namespace
}  // namespace trocar::organ
