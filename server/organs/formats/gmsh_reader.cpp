#include "server/organs/formats/gmsh_reader.h"

#include <algorithm>

#include "server/organs/formats/gmsh_mesh.h"

namespace trocar::formats {
namespace {

constexpr const char* kFormats =
    "versions 1, 2 to 2.2 and 4.1 are read, convert with: gmsh IN -save -format msh41 -o OUT.msh";

Status read_format(TextReader& in, GmshMesh& mesh) {
  if (!in.next_line()) return in.error("is empty");
  if (in.line() == "$NOD") return read_gmsh_lines(in, 1, mesh);
  if (in.line() != "$MeshFormat")
    return in.error(std::string("does not begin with $MeshFormat: ") + kFormats);
  if (auto s = in.need_line("$MeshFormat"); !s) return s;
  const auto version = in.word(), type = in.word(), size = in.word();
  double number = 0;
  const bool is_number = parse_finite(version, number);  // Netgen writes 2.000000
  const bool is_version4 = is_number && number == 4.1;
  if (!is_version4 && !(is_number && number >= 2 && number <= 2.2))
    return in.error("is Gmsh version " + shown(version) + ": " + kFormats);
  if ((type != "0" && type != "1") || size != "8" || !in.word().empty())
    return in.error("format line must be '" + std::string(version) + " 0 8' or '" +
                    std::string(version) + " 1 8'");
  const bool is_binary = type == "1";
  if (is_binary) {
    const auto one = in.bytes(4);
    if (one != std::string_view("\1\0\0\0", 4))
      return in.error("the byte order is not that of this machine: save the file as text");
  }
  if (auto s = need_gmsh_end(in, "$EndMeshFormat"); !s) return s;
  if (is_version4) return read_gmsh4(in, is_binary, mesh);
  return is_binary ? read_gmsh_binary2(in, mesh) : read_gmsh_lines(in, 2, mesh);
}

}  // namespace

Status read_gmsh_count(TextReader& in, std::string_view section, std::string_view what,
                       std::int64_t least_bytes, std::int64_t& count) {
  if (auto s = in.need_line(section); !s) return s;
  const std::string text(in.line());
  if (!parse_whole(in.word(), count) || !in.word().empty())
    return in.error("number of " + std::string(what) + " is " + shown(text) +
                    ", must be a whole number");
  return in.check_count(count, least_bytes, what);
}

Status need_gmsh_end(TextReader& in, std::string_view end, bool is_behind) {
  if (is_behind)
    if (auto s = in.need_line("$" + std::string(end.substr(4))); !s) return s;
  if (in.line() == end) return {};
  return in.error("expected " + std::string(end) + ", found " + shown(in.line()));
}

Status skip_gmsh_section(TextReader& in, GmshMesh& mesh) {
  if (in.line() == "$ParametricNodes")
    return in.error("has $ParametricNodes: save the mesh without them (Mesh.SaveParametric)");
  if (in.line() != "$Comments") mesh.leave_out(in.line());
  const std::string name(in.line().substr(std::min<std::size_t>(1, in.line().size())));
  const auto begins =
      in.error("section " + shown("$" + name) + " is never closed by " + shown("$End" + name));
  const std::string end = "$End" + name;
  while (in.next_line())
    if (in.line() == end) return {};
  return begins;
}

Status read_physical_names(TextReader& in, GmshMesh& mesh) {
  if (auto s = in.need_line("$PhysicalNames"); !s) return s;
  std::int64_t count = 0;
  if (auto s = in.read_whole("the number of physical groups", count); !s) return s;
  if (auto s = in.check_count(count, 6, "physical groups"); !s) return s;
  for (std::int64_t i = 0; i < count; ++i) {
    if (auto s = in.need_line("$PhysicalNames"); !s) return s;
    std::int64_t dimension = 0, number = 0;
    if (!parse_whole(in.word(), dimension) || !parse_whole(in.word(), number))
      return in.error("a physical group needs a dimension and a number");
    const auto begin = std::min(in.line().find('"'), in.line().size());
    if (auto s = mesh.add_physical_name(dimension, number, in.line().substr(begin)); !s) return s;
  }
  return need_gmsh_end(in, "$EndPhysicalNames");
}

Result<mesh::RawTets> parse_gmsh(std::string_view text, const std::string& name) {
  if (text.empty()) return Error{ErrorCode::BadFile, name + ": is empty"};
  TextReader in(text, name);
  GmshMesh mesh(in);
  if (auto s = read_format(in, mesh); !s) return s.error();
  return mesh.finish();
}

}  // namespace trocar::formats
