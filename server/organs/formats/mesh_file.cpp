#include "server/organs/formats/mesh_file.h"

#include <algorithm>
#include <fstream>
#include <variant>

#include "server/organs/formats/abaqus_reader.h"
#include "server/organs/formats/glb_reader.h"
#include "server/organs/formats/gmsh_reader.h"
#include "server/organs/formats/medit_reader.h"
#include "server/organs/formats/obj_reader.h"
#include "server/organs/formats/ply_reader.h"
#include "server/organs/formats/stl_reader.h"
#include "server/organs/formats/tetgen_reader.h"
#include "server/organs/formats/text_reader.h"
#include "server/organs/formats/vtu_reader.h"

namespace trocar::formats {
namespace {

constexpr std::uintmax_t kMaxFileBytes = std::uintmax_t{1} << 30;

std::string lower_ending(const std::filesystem::path& path) {
  return lower(path.extension().string());
}

template <typename T>
Result<TetsOrSurface> either(Result<T> result) {
  if (!result) return result.error();
  return TetsOrSurface(std::move(*result));
}

// 3D Slicer writes "SPACE=LPS" into a comment or the header.
surface::Axes said_axes(std::string_view text) {
  constexpr std::size_t kBeginning = 1024;
  const auto begin = text.substr(0, kBeginning);
  if (begin.find("SPACE=RAS") != std::string_view::npos) return surface::Axes::Ras;
  if (begin.find("SPACE=LPS") != std::string_view::npos) return surface::Axes::Lps;
  return surface::Axes::Unsaid;
}

Result<TetsOrSurface> parse(std::string_view text, const std::string& name);

}  // namespace

bool is_mesh_file(const std::filesystem::path& path) {
  static constexpr std::string_view kEndings[] = {".msh", ".vtk", ".vtu", ".node", ".ele", ".mesh",
                                                  ".inp", ".stl", ".obj", ".ply",  ".glb"};
  return std::ranges::find(kEndings, lower_ending(path)) != std::end(kEndings);
}

Result<std::string> read_foreign_file(const std::filesystem::path& path) {
  const std::string name = path.string();
  std::error_code failure;
  const auto bytes = std::filesystem::file_size(path, failure);
  if (failure) return Error{ErrorCode::BadFile, name + ": cannot be opened: " + failure.message()};
  if (bytes > kMaxFileBytes)
    return Error{ErrorCode::BadFile, name + ": is larger than 1 GiB: use a coarser mesh"};
  std::ifstream file(path, std::ios::binary);
  std::string text(static_cast<std::size_t>(bytes), '\0');
  if (!file || !file.read(text.data(), static_cast<std::streamsize>(text.size())))
    return Error{ErrorCode::BadFile, name + ": cannot be read"};
  return text;
}

Result<TetsOrSurface> parse_mesh(std::string_view text, const std::string& name) {
  if (text.starts_with("\xff\xfe") || text.starts_with("\xfe\xff"))
    return Error{ErrorCode::BadFile, name + ": is in UTF-16: save it in UTF-8"};
  text = behind_mark(text);
  auto result = parse(text, name);
  if (!result) return result;
  auto* surface = std::get_if<surface::RawSurface>(&*result);
  if (surface != nullptr && surface->axes == surface::Axes::Unsaid) surface->axes = said_axes(text);
  return result;
}

namespace {

Result<TetsOrSurface> parse(std::string_view text, const std::string& name) {
  if (text.empty()) return Error{ErrorCode::BadFile, name + ": is empty"};
  const auto begins = [&](std::string_view what) { return text.starts_with(what); };
  const std::string ending = lower_ending(name);
  if (begins("# vtk DataFile") || ending == ".vtk") return parse_vtk(text, name);
  if (begins("$MeshFormat") || begins("$NOD")) return either(parse_gmsh(text, name));
  if (begins("ply\n") || begins("ply\r") || ending == ".ply") return either(parse_ply(text, name));
  if (begins("MeshVersionFormatted") || ending == ".mesh") return either(parse_medit(text, name));
  if (begins("glTF") || ending == ".glb") return either(parse_glb(text, name));
  if (begins("<VTKFile") || ending == ".vtu") return either(parse_vtu(text, name));
  if (ending == ".msh") return either(parse_gmsh(text, name));
  if (ending == ".inp") return either(parse_abaqus(text, name));
  if (ending == ".stl") return either(parse_stl(text, name));
  if (ending == ".obj") return either(parse_obj(text, name));
  return Error{ErrorCode::BadFile, name + ": is of no kind that can be imported: " + kMeshEndings};
}

}  // namespace

Result<TetsOrSurface> read_mesh_file(const std::filesystem::path& path) {
  const std::string ending = lower_ending(path);
  if (ending == ".node" || ending == ".ele") {
    auto node_path = path, element_path = path;
    node_path.replace_extension(".node");
    element_path.replace_extension(".ele");
    const auto nodes = read_foreign_file(node_path);
    if (!nodes) return nodes.error();
    const auto elements = read_foreign_file(element_path);
    if (!elements) return elements.error();
    return either(parse_tetgen(behind_mark(*nodes), node_path.string(), behind_mark(*elements),
                               element_path.string()));
  }
  const auto text = read_foreign_file(path);
  if (!text) return text.error();
  return parse_mesh(*text, path.string());
}

}  // namespace trocar::formats
