#include "client/shape/tissue_look.h"

#include <algorithm>
#include <numeric>

namespace trocar::shape {
namespace {

char lower(char c) {
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 'a' - 'A') : c;
}

bool has_word(std::string_view name, std::string_view word) {
  const auto at = std::search(name.begin(), name.end(), word.begin(), word.end(),
                              [](char a, char b) { return lower(a) == b; });
  return at != name.end();
}

bool is_black(const Vec3f& c) {
  return c == Vec3f{};
}

}  // namespace

const TissueLook& look_of(std::string_view organ_name) {
  for (const TissueLook& look : kTissueLooks)
    for (std::string_view left = look.words; !left.empty();) {
      const std::size_t end = std::min(left.find(' '), left.size());
      if (has_word(organ_name, left.substr(0, end))) return look;
      left.remove_prefix(std::min(end + 1, left.size()));
    }
  return kTissueLooks.front();
}

LookFigures outside_figures(const TissueLook& look) {
  LookFigures out;
  out.dark.fill(look.dark);
  out.light.fill(look.light);
  for (std::size_t i = 0; i < look.loose.size(); ++i)
    if (!is_black(look.loose[i])) {
      out.dark[i + 1] = look.loose[i] * 0.95f;
      out.light[i + 1] = look.loose[i];
    }
  out.lines = {look.line.x, look.line.y, look.line.z, look.lines};
  out.figures = {look.pattern, look.gloss, look.relief, look.translucency};
  return out;
}

LookFigures inside_figures(const TissueLook& look) {
  LookFigures out = outside_figures(look);
  for (std::size_t i = 0; i < kLookParts; ++i)
    if (i == 0 || is_black(look.loose[i - 1]))
      out.dark[i] = look.cut_dark, out.light[i] = look.cut_light;
  out.lines = {look.septum.x, look.septum.y, look.septum.z, look.septa};
  out.figures[3] = look.lobules;
  return out;
}

std::vector<std::uint8_t> parts_of(const TissueLook& look, std::size_t vertices,
                                   std::span<const TriangleCorners> triangles,
                                   std::span<const std::uint32_t> held) {
  std::vector<std::uint8_t> parts(vertices, 0);
  if (std::ranges::all_of(look.loose, is_black)) return parts;
  std::vector<std::uint32_t> first(vertices);  // of its part, as far as is known
  std::iota(first.begin(), first.end(), 0u);
  const auto find = [&](std::uint32_t v) {
    while (first[v] != v) v = first[v] = first[first[v]];
    return v;
  };
  for (const auto& t : triangles)
    for (const std::uint32_t v : {t[1], t[2]}) {
      const std::uint32_t a = find(t[0]), b = find(v);
      first[std::max(a, b)] = std::min(a, b);
    }
  constexpr std::uint8_t kNew = 255;
  std::vector<std::uint8_t> number(vertices, kNew);  // of a part, at its first vertex
  for (const std::uint32_t v : held)
    if (v < vertices) number[find(v)] = 0;
  std::uint8_t next = 1;
  for (std::uint32_t v = 0; v < vertices; ++v) {
    std::uint8_t& part = number[find(v)];
    if (part == kNew) part = next, next = std::min<std::uint8_t>(next + 1, kLookParts - 1);
    parts[v] = part;
  }
  return parts;
}

}  // namespace trocar::shape
