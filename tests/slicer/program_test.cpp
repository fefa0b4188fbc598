// trocar-igtl between a real trocar-server and OpenIGTLink's own client.

#include <gtest/gtest.h>
#include <igtlImageMessage.h>
#include <igtlPolyDataMessage.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "client/slicer/peers.h"
#include "common/math/box.h"
#include "tests/e2e/programs.h"
#include "tests/slicer/slicer_peer.h"

namespace trocar::slicer {
namespace {

namespace fs = std::filesystem;
using e2e::Program;

// The shaft points to the front, away from the organ.
Transform upright(const Vec3f& ras_mm) {
  return {{{-1, 0, 0, ras_mm.x}, {0, 0, 1, ras_mm.y}, {0, 1, 0, ras_mm.z}}};
}

// Returns the foremost point near the middle, A being the front.
Vec3f middle_of_front(const std::vector<Vec3f>& points_mm) {
  Box<float> box;
  for (const auto& p : points_mm) box.include(p);
  const Vec3f middle = (box.least + box.most) * 0.5f;
  const auto worth = [&](const Vec3f& p) {
    return p.y - std::abs(p.x - middle.x) - std::abs(p.z - middle.z);
  };
  return *std::max_element(points_mm.begin(), points_mm.end(),
                           [&](const Vec3f& a, const Vec3f& b) { return worth(a) < worth(b); });
}

double newtons(const std::string& text) {
  return text.empty() ? 0 : std::stod(text);
}

class LinkProgram : public ::testing::Test {
 protected:
  ~LinkProgram() override { fs::remove_all(folder_); }

  void start_server(const std::string& organ) {
    server_.emplace("trocar-server",
                    std::vector<std::string>{"--organ", organ, "--listen", "127.0.0.1:0",
                                             "--journal", "none", "--insecure-loopback",
                                             "--ready-file", (folder_ / "server").string()},
                    folder_ / "server.log");
    ASSERT_TRUE(e2e::wait_for_file(folder_ / "server", 60));
  }
  // Returns its port.
  int start_link(std::vector<std::string> arguments) {
    const auto server =
        server_ ? e2e::ready_address(folder_ / "server") : std::string("127.0.0.1:0");
    arguments.insert(arguments.end(), {"--listen", "127.0.0.1:0", "--insecure-loopback", "--server",
                                       server, "--ready-file", (folder_ / "link").string()});
    link_.emplace("trocar-igtl", arguments, folder_ / "link.log");
    EXPECT_TRUE(e2e::wait_for_file(folder_ / "link", 20)) << log();
    return std::stoi(e2e::ready_address(folder_ / "link").substr(10));
  }
  std::string log() const { return e2e::read_text(folder_ / "link.log"); }

  const fs::path folder_ = e2e::test_folder();
  std::optional<Program> server_, link_;
};

TEST_F(LinkProgram, APeerSeesTheSessionAndPressesWithATrackedTool) {
  start_server("plate");
  const int port = start_link({"--hold", "Stylus=probe", "--name", "Slicer", "--sensor"});
  SlicerPeer peer(port);
  ASSERT_TRUE(peer.receive_until([&] { return peer.surfaces > 0; })) << log();
  const auto rest = peer.surface;
  EXPECT_GT(rest.triangles, 100u);
  EXPECT_EQ(rest.wounds, 0u);
  const Vec3f top = middle_of_front(rest.points_mm);
  for (float depth_mm = -12; depth_mm <= -6; ++depth_mm)
    peer.send_transform("Stylus", upright(top - Vec3f{0, depth_mm, 0}));
  ASSERT_TRUE(peer.receive_until([&] { return peer.transforms.contains("Slicer_R"); })) << log();
  EXPECT_TRUE(peer.receive_until(
      [&] { return std::abs(peer.transforms["Slicer_R"][1][3] - top.y - 6) < 0.1f; }));
  EXPECT_LT(newtons(peer.texts["Slicer_R_force"]), 0.001);
  float depth_mm = -6;
  ASSERT_TRUE(peer.receive_until([&] {
    depth_mm = std::min(depth_mm + 0.25f, 4.0f);
    peer.send_transform("Stylus", upright(top - Vec3f{0, depth_mm, 0}));
    return depth_mm == 4 && newtons(peer.texts["Slicer_R_force"]) > 0.05;
  })) << peer.texts["Slicer_R_force"]
      << log();
  // It pushes the tool to the front, and the surface gives way.
  ASSERT_TRUE(peer.receive_until([&] { return !peer.sensors["Slicer_R"].empty(); }));
  EXPECT_GT(peer.sensors["Slicer_R"][1], 0);
  EXPECT_TRUE(peer.receive_until([&] {
    float moved_mm = 0;
    for (std::size_t i = 0; i < rest.points_mm.size(); ++i)
      moved_mm = std::max(moved_mm, length(peer.surface.points_mm[i] - rest.points_mm[i]));
    return moved_mm > 0.1f;  // a stiff organ
  }));
  EXPECT_TRUE(peer.statuses["Trocar"].starts_with("1 ")) << peer.statuses["Trocar"];
  // Another peer cannot take the instrument over, and sees that; when the first goes, it can.
  SlicerPeer other(port);
  other.send_transform("Stylus", upright(top + Vec3f{0, 20, 0}));
  EXPECT_TRUE(other.receive_until([&] { return other.statuses.contains("Trocar_refused"); }));
  EXPECT_NE(other.statuses["Trocar_refused"].find("another peer holds"), std::string::npos);
  peer.leave();
  EXPECT_TRUE(other.receive_until([&] {
    other.send_transform("Stylus", upright(top + Vec3f{0, 20, 0}));
    return std::abs(other.transforms["Slicer_R"][1][3] - top.y - 20) < 0.1f;
  }));
  EXPECT_TRUE(server_->is_running());
}

TEST_F(LinkProgram, AKnifeFromSlicerCutsAndTheSurfaceGetsOtherTriangles) {
  start_server("liver");
  SlicerPeer peer(start_link({"--hold", "Knife=scalpel", "--surface-rate", "30"}));
  ASSERT_TRUE(peer.receive_until([&] { return peer.surfaces > 0; })) << log();
  const auto rest = peer.surface;
  const Vec3f top = middle_of_front(rest.points_mm);
  peer.send_text("Knife", "cut");
  float way_mm = 0;
  EXPECT_TRUE(peer.receive_until([&] {
    way_mm += 0.5f;
    const float depth_mm = std::min(way_mm - 10, 5.0f);
    peer.send_transform("Knife", upright(top + Vec3f{std::max(way_mm - 15, 0.0f), -depth_mm, 0}));
    return peer.surface.wounds > 0;
  })) << way_mm
      << log();
  EXPECT_NE(peer.surface.triangles, rest.triangles);
  EXPECT_GT(peer.surface.points_mm.size(), rest.points_mm.size());
}

// An ellipsoid of three unlike half axes, so that a turned or mirrored one is seen.
constexpr Vec3f kCentre_mm{30, -20, 50}, kHalf_mm{40, 30, 24};
constexpr int kVoxels = 26;
constexpr float kStep_mm = 4;

void send_ellipsoid(SlicerPeer& peer) {
  const auto image = igtl::ImageMessage::New();
  int size[3] = {kVoxels, kVoxels, kVoxels}, offset[3] = {0, 0, 0};
  image->SetDimensions(size);
  image->SetSpacing(kStep_mm, kStep_mm, kStep_mm);
  image->SetScalarType(igtl::ImageMessage::TYPE_UINT8);
  image->SetSubVolume(size, offset);
  image->AllocateScalars();
  auto* voxel = static_cast<std::uint8_t*>(image->GetScalarPointer());
  const auto at = [](int i) { return kStep_mm * (static_cast<float>(i) - 0.5f * (kVoxels - 1)); };
  for (int k = 0; k < kVoxels; ++k)
    for (int j = 0; j < kVoxels; ++j)
      for (int i = 0; i < kVoxels; ++i) {
        const Vec3f p{at(i) / kHalf_mm.x, at(j) / kHalf_mm.y, at(k) / kHalf_mm.z};
        *voxel++ = length(p) <= 1 ? 1 : 0;
      }
  igtl::Matrix4x4 matrix{
      {1, 0, 0, kCentre_mm.x}, {0, 1, 0, kCentre_mm.y}, {0, 0, 1, kCentre_mm.z}, {0, 0, 0, 1}};
  image->SetMatrix(matrix);
  peer.send(*image, "Liver label");
}

// An octahedron in strips of the same place: coarse, but near enough to the mesh.
void send_fine_surface(SlicerPeer& peer) {
  const auto message = igtl::PolyDataMessage::New();
  const auto points = igtl::PolyDataPointArray::New();
  const auto polygons = igtl::PolyDataCellArray::New();
  constexpr int kAround = 24, kRings = 12;
  const auto add = [&](float polar, float around) {
    points->AddPoint(kCentre_mm.x + kHalf_mm.x * std::sin(polar) * std::cos(around),
                     kCentre_mm.y + kHalf_mm.y * std::sin(polar) * std::sin(around),
                     kCentre_mm.z + kHalf_mm.z * std::cos(polar));
  };
  constexpr float kPi = 3.14159265f;
  for (int ring = 0; ring <= kRings; ++ring)
    for (int i = 0; i < kAround; ++i)
      add(kPi * (0.5f + static_cast<float>(ring)) / (kRings + 1),
          2 * kPi * static_cast<float>(i) / kAround);
  for (int ring = 0; ring < kRings; ++ring)
    for (int i = 0; i < kAround; ++i) {
      const auto index = [&](int r, int n) {
        return static_cast<igtlUint32>(r * kAround + n % kAround);
      };
      igtlUint32 corners[4] = {index(ring, i), index(ring + 1, i), index(ring + 1, i + 1),
                               index(ring, i + 1)};
      polygons->AddCell(4, corners);
    }
  message->SetPoints(points);
  message->SetPolygons(polygons);
  peer.send(*message, "Fine");
}

TEST_F(LinkProgram, ALabelMapBecomesASessionThatItsSenderWatches) {
  SlicerPeer peer(start_link({"--serve", "--folder", folder_.string(), "--nodes", "400"}));
  ASSERT_TRUE(peer.receive_until([&] { return peer.statuses.contains("Trocar"); }));
  EXPECT_EQ(peer.statuses["Trocar"], "13 waiting for a label map");
  send_ellipsoid(peer);
  ASSERT_TRUE(peer.receive_until([&] { return peer.surfaces > 0; }, 60)) << log();
  // The surface lies where the scan has it.
  Box<float> box;
  for (const auto& p : peer.surface.points_mm) box.include(p);
  const Vec3f centre = (box.least + box.most) * 0.5f, half = (box.most - box.least) * 0.5f;
  EXPECT_LT(length(centre - kCentre_mm), 2) << centre.x << " " << centre.y << " " << centre.z;
  EXPECT_LT(length(half - kHalf_mm), 4) << half.x << " " << half.y << " " << half.z;
  EXPECT_TRUE(fs::exists(folder_ / "Liver_label-1.nii"));
  EXPECT_TRUE(fs::exists(folder_ / "Liver_label-1.organ"));
  // A fine surface makes the organ again, and another session.
  send_fine_surface(peer);
  const int before = peer.surfaces;
  ASSERT_TRUE(peer.receive_until([&] { return peer.surfaces > before; }, 60)) << log();
  EXPECT_TRUE(fs::exists(folder_ / "Fine-1.obj"));
  EXPECT_NE(log().find("fine surface of 576 triangles"), std::string::npos) << log();
  EXPECT_TRUE(peer.receive_until([&] { return peer.statuses["Trocar"].starts_with("1 "); }));
  link_->signal(SIGTERM);
  EXPECT_EQ(link_->wait(30), 0) << log();
}

// A header with these figures and no body.
std::string header_of(const std::string& type, std::uint64_t body_bytes, std::uint64_t crc = 0) {
  std::string bytes(kHeaderBytes, '\0');
  bytes[1] = 1;
  type.copy(bytes.data() + 2, 12);
  const auto put = [&](std::size_t at, std::uint64_t number) {
    for (std::size_t i = 0; i < 8; ++i) bytes[at + i] = static_cast<char>(number >> (56 - 8 * i));
  };
  put(42, body_bytes);
  put(50, crc);
  return bytes;
}

TEST_F(LinkProgram, TheSessionNeverNoticesWhatPeersDo) {
  start_server("plate");
  const int port = start_link({"--hold", "Stylus=probe"});
  const auto says = [&](SlicerPeer& peer, const std::string& what) {
    peer.statuses.erase("Trocar_refused");
    EXPECT_TRUE(peer.receive_until([&] { return peer.statuses.contains("Trocar_refused"); }))
        << what;
    EXPECT_NE(peer.statuses["Trocar_refused"].find(what), std::string::npos)
        << peer.statuses["Trocar_refused"];
  };
  {
    SlicerPeer peer(port);
    // The unknown is passed over, the wrong is told, and the next message is read.
    peer.send_bytes(header_of("VIDEO", 100'000) + std::string(100'000, 'v'));
    peer.send_bytes(header_of("TRANSFORM", 48, 1) + std::string(48, 'x'));
    peer.send_transform("Stylus", {});
    says(peer, "TRANSFORM 'Stylus': matrix: is no rotation");
    peer.send_transform("Stylus", upright({0, 1e6f, 0}));
    says(peer, "allowed are 2000");
    peer.send_bytes(header_of("IMAGE", std::uint64_t{200} << 20));
    says(peer, "IMAGE '': body_size is 209715200 bytes, allowed are 134283336");
    // It goes in the midst of that body.
  }
  {
    SlicerPeer peer(port);
    send_ellipsoid(peer);
    says(peer, "nothing is taken");
    // A tracker that has lost its tool is borne with, damage is not.
    for (int i = 0; i < 30; ++i) peer.send_transform("Stylus", {});
    says(peer, "is no rotation");
    constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
    for (int i = 0; i < kMostFaults; ++i) peer.send_transform("Stylus", upright({kNan, 0, 0}));
    EXPECT_FALSE(peer.receive_until([] { return false; }, 10));
    EXPECT_TRUE(peer.is_cut());
  }
  {
    SlicerPeer peer(port);
    peer.send_bytes("GET / HTTP/1.1\r\nHost: localhost\r\nAccept: text/html, */*\r\n\r\n");
    EXPECT_FALSE(peer.receive_until([] { return false; }, 10));
    EXPECT_TRUE(peer.is_cut());
  }
  SlicerPeer good(port);
  EXPECT_TRUE(good.receive_until([&] { return good.statuses["Trocar"].starts_with("1 "); }));
  EXPECT_NE(log().find("version is 18245"), std::string::npos) << log();
  EXPECT_EQ(e2e::read_text(folder_ / "server.log").find("error"), std::string::npos);
  // The link ends with its session.
  server_->signal(SIGTERM);
  EXPECT_EQ(link_->wait(30), 0) << log();
}

TEST_F(LinkProgram, APeerThatTakesNothingHoldsNobodyUp) {
  start_server("plate");
  const int port = start_link({"--hold", "Stylus=probe", "--surface-rate", "60"});
  const SlicerPeer lazy(port);
  SlicerPeer good(port);
  ASSERT_TRUE(good.receive_until([&] { return good.surfaces > 0; })) << log();
  const Vec3f top = middle_of_front(good.surface.points_mm);
  const int before = good.surfaces;
  float turn = 0;
  EXPECT_TRUE(good.receive_until([&] {
    turn += 0.02f;
    good.send_transform("Stylus", upright(top - Vec3f{0, 4 * std::sin(turn), 0}));
    return good.surfaces > before + 20;
  })) << good.surfaces;
  EXPECT_TRUE(server_->is_running());
  EXPECT_TRUE(link_->is_running());
}

}  // namespace
}  // namespace trocar::slicer
