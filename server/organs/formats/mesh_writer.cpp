#include "server/organs/formats/mesh_writer.h"

#include <algorithm>
#include <charconv>
#include <cstring>

#include "common/base/json.h"
#include "server/organs/formats/glb_numbers.h"

namespace trocar::formats {
namespace {

// The shortest text that reads as the same number.
void put_number(std::string& out, double value) {
  char text[40];
  const auto [end, error] = std::to_chars(text, text + sizeof text, value);
  out.append(text, end);
}

Vec3d place_of(const WrittenMesh& written, std::size_t node) {
  return (written.mesh.rest_positions[node] + written.offset_m) *
         (1 / mesh::metres_of(written.unit));
}

void put_place(std::string& out, const Vec3d& p) {
  for (const double c : {p.x, p.y, p.z}) {
    out += ' ';
    put_number(out, c);
  }
}

std::size_t region_of(const WrittenMesh& written, std::size_t tet) {
  return written.tet_regions.empty() ? 0 : written.tet_regions[tet];
}

// A name inside quotation marks.
std::string quotable(std::string text) {
  std::replace(text.begin(), text.end(), '"', '_');
  return text;
}

template <typename T>
void put_bytes(std::string& out, T value) {
  out.append(reinterpret_cast<const char*>(&value), sizeof value);
}

template <typename List, typename Put>
void put_array(std::string& out, const char* type, const char* name, const char* components,
               const List& list, const Put& put) {
  out += std::string("<DataArray type=\"") + type + "\" Name=\"" + name +
         "\" NumberOfComponents=\"" + components + "\" format=\"ascii\">\n";
  for (std::size_t i = 0; i < list.size(); ++i) put(i);
  out += "</DataArray>\n";
}

}  // namespace

// Physical group r + 1 is region r; group 1 of points holds the nodes that are held.
std::string to_gmsh(const WrittenMesh& written) {
  const auto& mesh = written.mesh;
  const bool has_held = !written.held_nodes.empty();
  std::string out = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n" +
                    std::to_string(written.region_names.size() + has_held) + "\n";
  if (has_held) out += "0 1 \"held\"\n";
  for (std::size_t r = 0; r < written.region_names.size(); ++r)
    out += "3 " + std::to_string(r + 1) + " \"" + quotable(written.region_names[r]) + "\"\n";
  out += "$EndPhysicalNames\n$Nodes\n" + std::to_string(mesh.node_count()) + "\n";
  for (std::size_t i = 0; i < mesh.node_count(); ++i) {
    out += std::to_string(i + 1);
    put_place(out, place_of(written, i));
    out += '\n';
  }
  out += "$EndNodes\n$Elements\n" + std::to_string(written.held_nodes.size() + mesh.tets.size()) +
         "\n";
  std::size_t number = 0;
  for (const NodeIndex node : written.held_nodes)
    out += std::to_string(++number) + " 15 2 1 1 " + std::to_string(node.value + 1) + "\n";
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    const std::string group = std::to_string(region_of(written, t) + 1);
    out += std::to_string(++number) + " 4 2 " + group + " " + group;
    for (const NodeIndex node : mesh.tets[t]) out += " " + std::to_string(node.value + 1);
    out += '\n';
  }
  return out + "$EndElements\n";
}

std::string to_vtu(const WrittenMesh& written) {
  const auto& mesh = written.mesh;
  std::string out =
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" "
      "byte_order=\"LittleEndian\">\n<UnstructuredGrid>\n<Piece NumberOfPoints=\"" +
      std::to_string(mesh.node_count()) + "\" NumberOfCells=\"" + std::to_string(mesh.tets.size()) +
      "\">\n<PointData>\n";
  std::vector<std::uint8_t> is_held(mesh.node_count(), 0);
  for (const NodeIndex node : written.held_nodes) is_held[node.value] = 1;
  put_array(out, "UInt8", "held", "1", is_held,
            [&](std::size_t i) { out += is_held[i] ? "1\n" : "0\n"; });
  out += "</PointData>\n<CellData>\n";
  put_array(out, "Int32", "region", "1", mesh.tets,
            [&](std::size_t t) { out += std::to_string(region_of(written, t)) + "\n"; });
  out += "</CellData>\n<Points>\n";
  put_array(out, "Float64", "Points", "3", mesh.rest_positions, [&](std::size_t i) {
    put_place(out, place_of(written, i));
    out += '\n';
  });
  out += "</Points>\n<Cells>\n";
  put_array(out, "Int64", "connectivity", "1", mesh.tets, [&](std::size_t t) {
    for (const NodeIndex node : mesh.tets[t]) out += std::to_string(node.value) + " ";
    out += '\n';
  });
  put_array(out, "Int64", "offsets", "1", mesh.tets,
            [&](std::size_t t) { out += std::to_string(4 * (t + 1)) + "\n"; });
  put_array(out, "UInt8", "types", "1", mesh.tets, [&](std::size_t) { out += "10\n"; });
  return out + "</Cells>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n";
}

std::string to_stl(const WrittenMesh& written) {
  std::string out = "binary STL, " + written.name;
  out.resize(80, ' ');
  put_bytes(out, static_cast<std::uint32_t>(written.mesh.boundary_triangles.size()));
  for (const auto& triangle : written.mesh.boundary_triangles) {
    Vec3d p[3];
    for (std::size_t i = 0; i < 3; ++i) p[i] = place_of(written, triangle[i].value);
    const Vec3d normal = normalized(cross(p[1] - p[0], p[2] - p[0]), {});
    for (const Vec3d& v : {normal, p[0], p[1], p[2]})
      for (const double c : {v.x, v.y, v.z}) put_bytes(out, static_cast<float>(c));
    put_bytes(out, std::uint16_t{0});
  }
  return out;
}

std::string to_glb(const WrittenMesh& written) {
  const auto& mesh = written.mesh;
  const auto normals = surface_normals(mesh);
  GlbSurface surface;
  surface.name = written.name;
  std::vector<std::uint32_t> vertex_of(mesh.node_count(), 0);
  for (const NodeIndex node : mesh.surface_nodes) {
    vertex_of[node.value] = static_cast<std::uint32_t>(surface.positions.size());
    surface.positions.push_back(to_float(mesh.rest_positions[node.value]));
    surface.normals.push_back(to_float(normals[node.value]));
  }
  for (const auto& [a, b, c] : mesh.boundary_triangles)
    surface.triangles.push_back({vertex_of[a.value], vertex_of[b.value], vertex_of[c.value]});
  return to_glb(surface);
}

std::string to_glb(const GlbSurface& surface) {
  constexpr int kVertices = 34962, kIndices = 34963;
  std::string body;
  Json views = Json::array(), accessors = Json::array();
  const auto add_view = [&](const std::string& part, int target) {
    Json view{{"buffer", 0}, {"byteOffset", body.size()}, {"byteLength", part.size()}};
    if (target != 0) view["target"] = target;
    views.push_back(view);
    body += part;
    body.resize((body.size() + 3) / 4 * 4, '\0');
  };
  const auto add = [&](const std::string& part, int target, int component, std::size_t count,
                       const char* type) {
    accessors.push_back({{"bufferView", views.size()},
                         {"componentType", component},
                         {"count", count},
                         {"type", type}});
    add_view(part, target);
  };
  std::string positions, directions, places, indices;
  Vec3f low{1e9f, 1e9f, 1e9f}, high{-1e9f, -1e9f, -1e9f};
  for (const Vec3f& p : surface.positions) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
    for (const float c : {p.x, p.y, p.z}) put_bytes(positions, c);
  }
  for (const Vec3f& n : surface.normals)
    for (const float c : {n.x, n.y, n.z}) put_bytes(directions, c);
  // The format counts downward from the upper edge.
  for (const auto& [u, v] : surface.texture)
    for (const float c : {u, 1 - v}) put_bytes(places, c);
  for (const auto& triangle : surface.triangles)
    for (const std::uint32_t vertex : triangle) put_bytes(indices, vertex);
  const std::size_t count = surface.positions.size();
  add(positions, kVertices, kFloat, count, "VEC3");
  accessors[0]["min"] = {low.x, low.y, low.z};
  accessors[0]["max"] = {high.x, high.y, high.z};
  Json attributes{{"POSITION", 0}};
  if (!surface.normals.empty()) {
    attributes["NORMAL"] = accessors.size();
    add(directions, kVertices, kFloat, count, "VEC3");
  }
  if (!surface.texture.empty()) {
    attributes["TEXCOORD_0"] = accessors.size();
    add(places, kVertices, kFloat, count, "VEC2");
  }
  Json primitive{{"attributes", attributes}, {"indices", accessors.size()}};
  add(indices, kIndices, kUInt32, 3 * surface.triangles.size(), "SCALAR");
  Json json{{"asset", {{"version", "2.0"}, {"generator", "trocar-organ"}}},
            {"scene", 0},
            {"scenes", Json::array({{{"nodes", {0}}}})},
            {"nodes", Json::array({{{"mesh", 0}, {"name", surface.name}}})}};
  if (!surface.picture.empty()) {
    primitive["material"] = 0;
    json["materials"] =
        Json::array({{{"pbrMetallicRoughness",
                       {{"baseColorTexture", {{"index", 0}}}, {"metallicFactor", 0}}}}});
    json["textures"] = Json::array({{{"source", 0}}});
    const bool is_png = surface.picture.starts_with("\x89PNG");
    json["images"] = Json::array(
        {{{"bufferView", views.size()}, {"mimeType", is_png ? "image/png" : "image/jpeg"}}});
    add_view(surface.picture, 0);
  }
  json["meshes"] = Json::array({{{"primitives", Json::array({primitive})}}});
  json["accessors"] = accessors;
  json["bufferViews"] = views;
  json["buffers"] = Json::array({{{"byteLength", body.size()}}});
  std::string text = json.dump(-1, ' ', true, Json::error_handler_t::replace);
  text.resize((text.size() + 3) / 4 * 4, ' ');
  std::string out = "glTF";
  put_bytes(out, std::uint32_t{2});
  put_bytes(out, static_cast<std::uint32_t>(12 + 8 + text.size() + 8 + body.size()));
  put_bytes(out, static_cast<std::uint32_t>(text.size()));
  out += "JSON" + text;
  put_bytes(out, static_cast<std::uint32_t>(body.size()));
  out += std::string("BIN\0", 4) + body;
  return out;
}

}  // namespace trocar::formats
