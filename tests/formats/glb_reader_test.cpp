// glTF binary files: what a scene says is read, and what cannot be read is named.

#include "server/organs/formats/glb_reader.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <string>

#include "common/base/json.h"
#include "server/organs/surface/closed_surface.h"

namespace trocar::formats {
namespace {

template <typename T>
void put(std::string& out, std::initializer_list<T> values) {
  for (const T value : values) out.append(reinterpret_cast<const char*>(&value), sizeof value);
  while (out.size() % 4 != 0) out += '\0';
}

const std::string kPicture = std::string("\x89PNG\r\n\x1a\n", 8) + "as good as one";

// A corner of the unit cube in two primitives: two faces by bytes, two by 16 bits.
struct Glb {
  Json json;
  std::string body;

  Glb() {
    json = {{"asset", {{"version", "2.0"}}},
            {"scenes", Json::array({{{"nodes", {0}}}})},
            {"nodes", Json::array({{{"mesh", 0}}})},
            {"bufferViews", Json::array()},
            {"accessors", Json::array()}};
    std::string part;
    put<float>(part, {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1});
    add(part, 5126, 4, "VEC3");
    part.clear();
    put<float>(part, {0, 0, 1, 0, 0, 0.25f, 1, 1});
    add(part, 5126, 4, "VEC2");
    part.clear();
    put<std::uint8_t>(part, {0, 2, 1, 0, 1, 3});
    add(part, 5121, 6, "SCALAR");
    part.clear();
    put<std::uint16_t>(part, {1, 2, 3, 0, 3, 2});
    add(part, 5123, 6, "SCALAR");
    const auto primitive = [](int indices) {
      return Json{{"attributes", {{"POSITION", 0}, {"TEXCOORD_0", 1}, {"NORMAL", 77}}},
                  {"indices", indices},
                  {"material", 0}};
    };
    json["meshes"] = Json::array({{{"primitives", Json::array({primitive(2), primitive(3)})}}});
    json["materials"] =
        Json::array({{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}});
    json["textures"] = Json::array({{{"source", 0}}});
    json["images"] = Json::array({{{"bufferView", 4}, {"mimeType", "image/png"}}});
    json["bufferViews"].push_back(
        {{"buffer", 0}, {"byteOffset", body.size()}, {"byteLength", kPicture.size()}});
    body += kPicture;
    while (body.size() % 4 != 0) body += '\0';
    json["buffers"] = Json::array({{{"byteLength", body.size()}}});
  }
  void add(const std::string& part, int component, int count, const char* type) {
    const auto number = json["bufferViews"].size();
    json["bufferViews"].push_back(
        {{"buffer", 0}, {"byteOffset", body.size()}, {"byteLength", part.size()}});
    json["accessors"].push_back(
        {{"bufferView", number}, {"componentType", component}, {"count", count}, {"type", type}});
    body += part;
  }
  std::string file() const {
    std::string text = json.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    const auto number = [](std::size_t value) {
      std::string out;
      put<std::uint32_t>(out, {static_cast<std::uint32_t>(value)});
      return out;
    };
    return "glTF" + number(2) + number(12 + 8 + text.size() + 8 + body.size()) +
           number(text.size()) + "JSON" + text + number(body.size()) + std::string("BIN\0", 4) +
           body;
  }
};

surface::RawSurface read(const Glb& glb) {
  auto raw = parse_glb(glb.file(), "a.glb");
  EXPECT_TRUE(raw.ok()) << raw.error().message;
  return raw.ok() ? std::move(*raw) : surface::RawSurface{};
}

std::string error_after(const std::function<void(Glb&)>& change) {
  Glb glb;
  change(glb);
  const auto raw = parse_glb(glb.file(), "a.glb");
  return raw.ok() ? "" : raw.error().message;
}

double volume_of(surface::RawSurface raw) {
  const auto solid = surface::check_surface(std::move(raw), mesh::Unit::Metre, "a");
  EXPECT_TRUE(solid.ok()) << solid.error().message;
  EXPECT_TRUE(!solid.ok() || solid->warnings.empty());
  return solid.ok() ? solid->volume_m3 : 0;
}

TEST(GlbReader, AllPrimitivesAreOneSurfaceWithItsPicture) {
  const auto raw = read(Glb());
  EXPECT_EQ(raw.positions.size(), 4u);
  ASSERT_EQ(raw.triangles.size(), 4u);
  EXPECT_EQ(raw.picture, kPicture);
  EXPECT_EQ(raw.texture_fault, "");
  EXPECT_EQ(raw.unit_m, 1.0);
  EXPECT_EQ(raw.axes, surface::Axes::LeftHeadFront);
  ASSERT_EQ(raw.corner_texture.size(), 4u);
  // The file counts downward from the upper edge.
  const std::array<double, 2> origin{0, 1}, up{0, 0.75};
  EXPECT_EQ(raw.corner_texture[0][0], origin);
  EXPECT_EQ(raw.corner_texture[0][1], up);
  EXPECT_NEAR(volume_of(raw), 1.0 / 6, 1e-12);
}

TEST(GlbReader, NodesMoveWhatHangsBelowThem) {
  Glb glb;
  // A quarter of a turn about z, then half as long again along x, and away.
  glb.json["nodes"] =
      Json::array({{{"children", {1, 2}}, {"translation", {5, 0, 0}}, {"scale", {1.5, 1, 1}}},
                   {{"mesh", 0}, {"rotation", {0, 0, std::sqrt(0.5), std::sqrt(0.5)}}},
                   {{"name", "empty"}}});
  const auto raw = read(glb);
  // (1, 0, 0) -> (0, 1, 0) -> (5, 1, 0); (0, 1, 0) -> (-1, 0, 0) -> (3.5, 0, 0).
  const auto has = [&](const Vec3d& place) {
    return std::ranges::any_of(raw.positions,
                               [&](const Vec3d& p) { return length(p - place) < 1e-12; });
  };
  EXPECT_TRUE(has({5, 1, 0}));
  EXPECT_TRUE(has({3.5, 0, 0}));
  EXPECT_NEAR(volume_of(raw), 1.5 / 6, 1e-12);
  // A mirror image still looks outward: volumes of surfaces that look inward come with a warning.
  glb.json["nodes"] =
      Json::array({{{"mesh", 0}, {"matrix", {-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 7, 0, 0, 1}}}});
  EXPECT_NEAR(volume_of(read(glb)), 1.0 / 6, 1e-12);
  // Two nodes may show one mesh.
  glb.json["nodes"] = Json::array({{{"mesh", 0}}, {{"mesh", 0}, {"translation", {3, 0, 0}}}});
  glb.json["scenes"][0]["nodes"] = {0, 1};
  EXPECT_EQ(read(glb).triangles.size(), 8u);
}

TEST(GlbReader, IndicesMayBeOfAnyWidthOrNone) {
  Glb glb;
  std::string wide, far;
  put<std::uint32_t>(wide, {1, 2, 3, 0, 3, 2});
  glb.add(wide, 5125, 6, "SCALAR");
  glb.json["meshes"][0]["primitives"][1]["indices"] = 4;
  glb.json["accessors"][4]["bufferView"] = 5;
  // Rows farther apart than they are long.
  put<float>(far, {0, 0, 0, 9, 1, 0, 0, 9, 0, 1, 0, 9, 0, 0, 1});
  glb.add(far, 5126, 4, "VEC3");
  glb.json["bufferViews"][6]["byteStride"] = 16;
  glb.json["accessors"][5]["bufferView"] = 6;
  glb.json["meshes"][0]["primitives"][1]["attributes"]["POSITION"] = 5;
  EXPECT_NEAR(volume_of(read(glb)), 1.0 / 6, 1e-12);
  Glb plain;
  std::string corners;
  put<float>(corners, {0, 0, 0, 0, 1, 0, 1, 0, 0});
  plain.add(corners, 5126, 3, "VEC3");
  plain.json["accessors"][4]["bufferView"] = 5;
  plain.json["meshes"][0]["primitives"] = Json::array({{{"attributes", {{"POSITION", 4}}}}});
  const auto raw = read(plain);
  EXPECT_EQ(raw.triangles.size(), 1u);
  EXPECT_TRUE(raw.corner_texture.empty());
  EXPECT_TRUE(raw.picture.empty());
}

TEST(GlbReader, PlacesWithoutAPictureAreKeptForAnother) {
  Glb glb;
  glb.json.erase("materials");
  for (auto& primitive : glb.json["meshes"][0]["primitives"]) primitive.erase("material");
  const auto raw = read(glb);
  EXPECT_EQ(raw.corner_texture.size(), 4u);
  EXPECT_TRUE(raw.picture.empty());
}

TEST(GlbReader, APictureThatIsNoneForAllIsNamed) {
  const auto fault_after = [](const std::function<void(Glb&)>& change) {
    Glb glb;
    change(glb);
    const auto raw = read(glb);
    EXPECT_TRUE(raw.corner_texture.empty());
    return raw.texture_fault;
  };
  EXPECT_EQ(fault_after([](Glb& g) {
              g.json["meshes"][0]["primitives"][1]["attributes"].erase("TEXCOORD_0");
            }),
            "a.glb: some of its meshes have no texture coordinates");
  EXPECT_EQ(fault_after([](Glb& g) {
              g.json["images"][0] = {{"uri", "liver.png"}};
            }),
            "a.glb: meshes[0].primitives[0]: its picture is in another file: save all in one");
  EXPECT_NE(fault_after([](Glb& g) {
              g.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] = {
                  {"KHR_texture_transform", {{"scale", {2, 2}}}}};
            }).find("moved by an extension"),
            std::string::npos);
  EXPECT_NE(fault_after([](Glb& g) {
              g.json["materials"].push_back(
                  {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 1}}}}}});
              g.json["textures"].push_back({{"source", 1}});
              g.json["images"].push_back({{"bufferView", 4}});
              g.json["meshes"][0]["primitives"][1]["material"] = 1;
            }).find("paint all on one"),
            std::string::npos);
}

TEST(GlbReader, WhatCannotBeReadIsNamed) {
  const std::pair<const char*, std::function<void(Glb&)>> cases[] = {
      {"needs the extension 'KHR_draco_mesh_compression', which is not read: save it without",
       [](Glb& g) { g.json["extensionsRequired"] = {"KHR_draco_mesh_compression"}; }},
      {"accessors[0] is sparse", [](Glb& g) { g.json["accessors"][0]["sparse"] = Json::object(); }},
      {"accessors[2] has 600 rows, its view holds fewer",
       [](Glb& g) { g.json["accessors"][2]["count"] = 600; }},
      {"accessors[0] has 0 rows", [](Glb& g) { g.json["accessors"][0]["count"] = 0; }},
      {"accessors[9] is not there",
       [](Glb& g) { g.json["meshes"][0]["primitives"][0]["indices"] = 9; }},
      {"accessors[0] is not of type VEC3", [](Glb& g) { g.json["accessors"][0]["type"] = "VEC2"; }},
      {"count is no whole number", [](Glb& g) { g.json["accessors"][0]["count"] = -4; }},
      {"accessors[0] has rows of 12 bytes every 4",
       [](Glb& g) { g.json["bufferViews"][0]["byteStride"] = 4; }},
      {"bufferViews[0] goes beyond the",
       [](Glb& g) { g.json["bufferViews"][0]["byteOffset"] = 4'000'000'000u; }},
      {"bufferViews[0] is in another file",
       [](Glb& g) { g.json["buffers"][0]["uri"] = "liver.bin"; }},
      {"refers to vertex 4, it has 4",
       [](Glb& g) { g.body[g.json["bufferViews"][2]["byteOffset"].get<std::size_t>()] = 4; }},
      {"vertex 0 is not finite", [](Glb& g) { g.body[2] = '\x80', g.body[3] = '\x7f'; }},
      {"nodes[0] has weights that change its shape",
       [](Glb& g) {
         g.json["meshes"][0]["weights"] = {0, 0.5};
       }},
      {"nodes[0] has weights that change its shape",
       [](Glb& g) {
         g.json["meshes"][0]["weights"] = {0};
         g.json["nodes"][0]["weights"] = {1};
       }},
      {"is a strip or fan", [](Glb& g) { g.json["meshes"][0]["primitives"][0]["mode"] = 5; }},
      {"has no triangles",
       [](Glb& g) {
         for (auto& primitive : g.json["meshes"][0]["primitives"]) primitive["mode"] = 1;
       }},
      {"corners, not three each", [](Glb& g) { g.json["accessors"][2]["count"] = 5; }},
      {"nodes[0] has a skin", [](Glb& g) { g.json["nodes"][0]["skin"] = 0; }},
      {"is below two others, or below itself",
       [](Glb& g) { g.json["nodes"][0]["children"] = {0}; }},
      {"meshes[0].primitives[0]: vertex 0 is not finite",
       [](Glb& g) {
         g.json["nodes"] = Json::array({{{"children", {1}}, {"scale", {1e200, 1, 1}}},
                                        {{"mesh", 0}, {"scale", {1e200, 1, 1}}}});
       }},
      {"nodes[0]: children holds what is no node's number",
       [](Glb& g) { g.json["nodes"][0]["children"] = {"1"}; }},
      {"nodes[123456789] is not there",
       [](Glb& g) { g.json["nodes"][0]["children"] = {123456789}; }},
      {"nodes[0]: rotation is not of length 1",
       [](Glb& g) {
         g.json["nodes"][0]["rotation"] = {1, 1, 0, 0};
       }},
      {"nodes[0]: scale has not 3 numbers",
       [](Glb& g) {
         g.json["nodes"][0]["scale"] = {1, 1};
       }},
      {"scenes[3] is not there", [](Glb& g) { g.json["scene"] = 3; }},
  };
  for (const auto& [words, change] : cases) {
    const auto error = error_after(change);
    EXPECT_TRUE(error.starts_with("a.glb: ")) << error;
    EXPECT_NE(error.find(words), std::string::npos) << error << "\n  instead of " << words;
  }
}

TEST(GlbReader, WhatIsNoTriangleInRestIsLeftOutAndSaid) {
  Glb glb;
  glb.json["meshes"][0]["weights"] = {0, 0.0};
  glb.json["meshes"][0]["primitives"][1]["mode"] = 1;
  glb.json["animations"] = Json::array({Json::object()});
  glb.json["scenes"].push_back(Json::object());
  const auto surface = parse_glb(glb.file(), "a.glb");
  ASSERT_TRUE(surface.ok()) << surface.error().message;
  EXPECT_EQ(surface->left_out,
            (std::vector<std::string>{"left out 1 lists of points or lines",
                                      "left out its animations: taken in its pose at rest",
                                      "left out the other 1 scenes"}));
}

TEST(GlbReader, NamesOfWhatIsInTheSceneAreSaid) {
  Glb glb;
  glb.json["nodes"][0]["name"] = "Gef\u00e4\u00df";
  glb.json["nodes"].push_back({{"name", "camera"}});
  glb.json["meshes"][0]["name"] = 7;
  const auto surface = parse_glb(glb.file(), "a.glb");
  ASSERT_TRUE(surface.ok()) << surface.error().message;
  EXPECT_EQ(surface->left_out,
            std::vector<std::string>{"left out the names of nodes: 'Gef\u00e4\u00df'"});
  glb.json["meshes"][0]["name"] = "vessel";
  const auto both = parse_glb(glb.file(), "a.glb");
  ASSERT_TRUE(both.ok());
  EXPECT_EQ(both->left_out.front(), "left out the names of meshes: 'vessel'");
}

TEST(GlbReader, AFileThatIsNoneIsRefusedAtEachLength) {
  const std::string whole = Glb().file();
  for (std::size_t size = 0; size < whole.size(); ++size)
    ASSERT_FALSE(parse_glb(whole.substr(0, size), "a.glb").ok()) << size;
  EXPECT_FALSE(parse_glb(whole + "more", "a.glb").ok());
  std::string old = whole;
  old[4] = 1;
  EXPECT_EQ(parse_glb(old, "a.glb").error().message, "a.glb: is of glTF version 1, 2 is read");
}

TEST(GlbReader, ManyNodesOfOneMeshBuildNoMoreThanTheirShare) {
  Glb glb;
  glb.json["nodes"] = Json::array();
  glb.json["scenes"][0]["nodes"] = Json::array();
  std::string indices;
  for (int i = 0; i < 20'000; ++i) indices.append({0, 2, 1});
  glb.add(indices, 5121, 60'000, "SCALAR");
  glb.json["accessors"][4]["bufferView"] = 5;
  glb.json["meshes"][0]["primitives"][0]["indices"] = 4;
  for (int i = 0; i < 2000; ++i) {
    glb.json["nodes"].push_back({{"mesh", 0}});
    glb.json["scenes"][0]["nodes"].push_back(i);
  }
  const auto raw = parse_glb(glb.file(), "a.glb");
  ASSERT_FALSE(raw.ok());
  EXPECT_NE(raw.error().message.find("far more than the file's"), std::string::npos);
}

TEST(GlbReader, NodesThatWaitAreCountedAsThoseThatWereRead) {
  // Each node of a chain leaves a thousand more waiting, all the same one.
  EXPECT_EQ(error_after([](Glb& g) {
              g.json["nodes"] = Json::array();
              for (int i = 0; i < 20; ++i) {
                std::vector<int> children(1001, 0);
                children[0] = i + 1;
                g.json["nodes"].push_back({{"children", children}});
              }
            }),
            "a.glb: has more than 10,000 nodes");
}

TEST(GlbReader, JsonThatIsFarMoreThanItsFileIsRefusedBeforeItIsRead) {
  const auto error_of = [](std::size_t lists) {
    return error_after([&](Glb& g) { g.json["extras"] = std::vector<Json>(lists, Json::array()); });
  };
  EXPECT_EQ(error_of(20'000), "");
  const auto error = error_of(60'000);
  EXPECT_NE(error.find("its JSON of some 120"), std::string::npos) << error;
}

TEST(GlbReader, PrimitivesOfAllNodesAreCounted) {
  const auto error = error_after([](Glb& g) {
    for (int i = 0; i < 1000; ++i) g.json["meshes"][0]["primitives"].push_back({{"mode", 1}});
    g.json["nodes"] = std::vector<Json>(100, Json{{"mesh", 0}});
    for (int i = 1; i < 100; ++i) g.json["scenes"][0]["nodes"].push_back(i);
  });
  EXPECT_NE(error.find("more than 100,000 primitives"), std::string::npos) << error;
}

TEST(GlbReader, OnlyChildrenHangBelowANode) {
  Glb glb;
  glb.json["nodes"] = Json::array({{{"mesh", 0}, {"nodes", {1}}}, {{"mesh", 0}}});
  EXPECT_EQ(read(glb).triangles.size(), 4u);
}

}  // namespace
}  // namespace trocar::formats
