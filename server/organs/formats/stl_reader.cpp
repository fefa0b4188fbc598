#include "server/organs/formats/stl_reader.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <vector>

#include "server/organs/formats/part_names.h"
#include "server/organs/formats/text_reader.h"
#include "server/organs/formats/weld.h"

namespace trocar::formats {
namespace {

constexpr std::size_t kHeaderBytes = 80, kTriangleBytes = 50;

Result<surface::RawSurface> parse_binary(std::string_view text, const std::string& name) {
  TextReader in(text, name);
  if (in.bytes(kHeaderBytes).empty()) return in.error("the file ends inside its header");
  const auto count_bytes = in.bytes(4);
  if (count_bytes.empty()) return in.error("the file ends inside its header");
  std::uint32_t count = 0;
  std::memcpy(&count, count_bytes.data(), sizeof count);
  if (std::uint64_t{count} * kTriangleBytes != in.remaining())
    return in.error("announces " + std::to_string(count) + " triangles, " +
                    std::to_string(in.remaining()) + " bytes follow, which are " +
                    std::to_string(in.remaining() / kTriangleBytes) +
                    (in.remaining() % kTriangleBytes == 0 ? "" : " and a part"));
  std::vector<Vec3d> corners;
  std::size_t painted = 0;
  for (std::uint32_t t = 0; t < count; ++t) {
    const auto bytes = in.bytes(kTriangleBytes);
    std::array<float, 12> numbers{};
    std::memcpy(numbers.data(), bytes.data(), sizeof numbers);
    painted += bytes.substr(sizeof numbers) != std::string_view("\0\0", 2);
    for (std::size_t i = 3; i < 12; i += 3) {
      const Vec3d p{numbers[i], numbers[i + 1], numbers[i + 2]};
      if (!is_finite(p))
        return in.error("triangle " + std::to_string(t + 1) + ": a coordinate of corner " +
                        std::to_string(i / 3) + " is not a finite number");
      corners.push_back(p);
    }
  }
  auto surface = weld(corners);
  if (painted > 0)
    surface.left_out.push_back("left out the attributes, such as colours, of " +
                               std::to_string(painted) + " triangles");
  return surface;
}

// Any number of solids after one another; each begins and ends with a line of its own. Keywords are
// of small or large letters.
Result<surface::RawSurface> parse_text(std::string_view text, const std::string& name) {
  TextReader in(text, name);
  std::vector<Vec3d> corners;
  PartNames parts;
  const auto expect = [&](std::initializer_list<std::string_view> words) -> Status {
    for (const auto word : words)
      if (const auto found = in.token(); lower(found) != word)
        return found.empty()
                   ? in.error("the file ends before '" + std::string(word) + "'")
                   : in.error("expected '" + std::string(word) + "', found " + shown(found));
    return {};
  };
  while (in.next_filled_line()) {
    if (lower(in.word()) != "solid") return in.error("expected 'solid', found " + shown(in.line()));
    parts.add("solids", in.line());
    if (auto s = in.need_line("solid"); !s) return s.error();
    while (lower(in.line().substr(0, 5)) == "facet") {
      if (auto s = expect({"facet", "normal"}); !s) return s.error();
      for (int i = 0; i < 3; ++i)
        if (in.token().empty()) return in.error("the file ends inside a normal");
      if (auto s = expect({"outer", "loop"}); !s) return s.error();
      const std::string what =
          "triangle " + std::to_string(corners.size() / 3 + 1) + ": coordinate";
      for (int corner = 0; corner < 3; ++corner) {
        if (auto s = expect({"vertex"}); !s) return s.error();
        Vec3d p;
        for (double* c : {&p.x, &p.y, &p.z})
          if (auto s = in.read_number(what, *c); !s) return s.error();
        corners.push_back(p);
      }
      if (auto s = expect({"endloop", "endfacet"}); !s) return s.error();
      if (auto s = in.need_line("solid"); !s) return s.error();
    }
    if (lower(in.word()) != "endsolid")
      return in.error("expected 'facet' or 'endsolid', found " + shown(in.line()));
  }
  auto surface = weld(corners);
  parts.say(surface.left_out);
  return surface;
}

}  // namespace

Result<surface::RawSurface> parse_stl(std::string_view text, const std::string& name) {
  if (text.empty()) return Error{ErrorCode::BadFile, name + ": is empty"};
  // A binary file may begin with "solid", too; then its length tells.
  std::uint32_t count = 0;
  if (text.size() >= kHeaderBytes + 4)
    std::memcpy(&count, text.data() + kHeaderBytes, sizeof count);
  const bool fits = text.size() >= kHeaderBytes + 4 &&
                    std::uint64_t{count} * kTriangleBytes + kHeaderBytes + 4 == text.size();
  const auto first = std::min(text.find_first_not_of(" \t\r\n"), text.size());
  const auto begin = text.substr(0, 512);
  const bool has_zeros = begin.find('\0') != std::string_view::npos;
  if (!fits && !has_zeros && lower(text.substr(first, 5)) == "solid") return parse_text(text, name);
  return parse_binary(text, name);
}

}  // namespace trocar::formats
