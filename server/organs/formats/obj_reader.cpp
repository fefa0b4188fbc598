#include "server/organs/formats/obj_reader.h"

#include <algorithm>
#include <array>
#include <optional>
#include <vector>

#include "server/organs/formats/part_names.h"
#include "server/organs/formats/polygon.h"
#include "server/organs/formats/text_reader.h"

namespace trocar::formats {
namespace {

constexpr std::string_view kSkippedKeywords[] = {"vn",     "vp", "g", "o",      "s",      "mtllib",
                                                 "usemtl", "l",  "p", "usemap", "maplib", "lod"};

// Each face is kept until all vertices are known: it may refer to later ones.
struct ObjFace {
  std::vector<std::int64_t> corners;                 // from 0
  std::vector<std::optional<std::int64_t>> texture;  // likewise, one for each corner, or none
  int line = 0;
};

// A number below 0 counts back from the last one there is. Empty, or what is wrong with it.
std::string read_number(std::string_view word, std::size_t count, std::int64_t& number) {
  if (!parse_whole(word, number) || number == 0) return "must be a whole number other than 0";
  const auto there = static_cast<std::int64_t>(count);
  if (number < -there) return std::to_string(count) + " come before it";
  number = number > 0 ? number - 1 : there + number;
  return {};
}

// "7", "7/1", "7//3" or "7/1/3"; numbers below 0 count back from the last vertex. What is wrong in
// a place in a picture is kept in `fault`, the first time.
Status read_corner(const TextReader& in, std::string_view word, std::size_t vertices,
                   std::size_t places, ObjFace& face, std::size_t face_number, std::string& fault) {
  std::int64_t number = 0;
  std::optional<std::int64_t> place;
  const auto slash = word.find('/');
  if (const auto wrong = read_number(word.substr(0, slash), vertices, number); !wrong.empty())
    return in.error("face " + std::to_string(face_number) + " refers to vertex " + shown(word) +
                    ", " + wrong);
  if (slash != std::string_view::npos) {
    const auto rest = word.substr(slash + 1);
    const auto text = rest.substr(0, rest.find('/'));
    std::int64_t read = 0;
    const auto wrong = text.empty() ? std::string() : read_number(text, places, read);
    if (!text.empty() && wrong.empty()) place = read;
    if (!wrong.empty() && fault.empty())
      fault = in.error("face " + std::to_string(face_number) + " refers to texture coordinate " +
                       shown(text) + ", " + wrong)
                  .message;
  }
  face.corners.push_back(number);
  face.texture.push_back(place);
  return {};
}

void read_place(TextReader& in, std::vector<std::array<double, 2>>& places, std::string& fault) {
  auto& place = places.emplace_back();
  const auto u = in.word(), v = in.word();
  // A picture of one dimension has u alone.
  const bool is_read = parse_finite(u, place[0]) && (v.empty() || parse_finite(v, place[1]));
  if (!is_read && fault.empty())
    fault =
        in.error("texture coordinate " + std::to_string(places.size()) + ": is not a finite number")
            .message;
}

// Gives each triangle its corners' places, if all faces have them and none is wrong. cuts: of each
// triangle in its face.
void add_texture(const std::vector<ObjFace>& faces, const std::vector<PolygonCut>& cuts,
                 const std::vector<std::array<double, 2>>& places, const std::string& name,
                 surface::RawSurface& surface) {
  if (!surface.texture_fault.empty()) return;
  for (const ObjFace& face : faces)
    for (const auto& place : face.texture) {
      if (!place) return;
      if (*place < static_cast<std::int64_t>(places.size())) continue;
      surface.texture_fault = name + ":" + std::to_string(face.line) +
                              ": refers to texture coordinate " + std::to_string(*place + 1) +
                              ", the file has " + std::to_string(places.size());
      return;
    }
  for (std::size_t t = 0; t < cuts.size(); ++t) {
    const ObjFace& face = faces[static_cast<std::size_t>(surface.face_numbers[t] - 1)];
    auto& corners = surface.corner_texture.emplace_back();
    for (std::size_t k = 0; k < 3; ++k)
      corners[k] = places[static_cast<std::size_t>(*face.texture[cuts[t][k]])];
  }
}

}  // namespace

Result<surface::RawSurface> parse_obj(std::string_view text, const std::string& name) {
  TextReader in(text, name, '#');
  surface::RawSurface surface;
  std::vector<ObjFace> faces;
  std::vector<std::array<double, 2>> places;  // in a picture
  std::size_t skipped = 0;                    // points and lines
  PartNames parts;
  while (in.next_line()) {
    const auto keyword = in.word();
    if (keyword.empty()) continue;
    if (keyword == "v") {
      Vec3d p;
      for (double* c : {&p.x, &p.y, &p.z})
        if (const auto word = in.word(); !parse_finite(word, *c))
          return in.error("vertex " + std::to_string(surface.positions.size() + 1) +
                          ": coordinate " + shown(word) + " is not a finite number");
      surface.positions.push_back(p);
    } else if (keyword == "vt") {
      read_place(in, places, surface.texture_fault);
    } else if (keyword == "f") {
      ObjFace face{{}, {}, in.line_number()};
      for (auto word = in.word(); !word.empty(); word = in.word())
        if (auto s = read_corner(in, word, surface.positions.size(), places.size(), face,
                                 faces.size() + 1, surface.texture_fault);
            !s)
          return s.error();
      faces.push_back(std::move(face));
    } else if (std::ranges::find(kSkippedKeywords, keyword) == std::end(kSkippedKeywords)) {
      return in.error(shown(keyword) + " is not known: save the surface as triangles");
    } else {
      skipped += keyword == "p" || keyword == "l";
      if (keyword == "o") parts.add("objects", in.line());
      if (keyword == "usemtl") parts.add("materials", in.line());
      if (keyword == "g")  // of a face that is in several
        for (auto word = in.word(); !word.empty(); word = in.word()) parts.add("groups", word);
    }
  }
  std::int64_t number = 0;
  std::vector<PolygonCut> cuts;  // of each triangle, if there are places
  for (const ObjFace& face : faces)
    if (auto s = add_polygon(face.corners, ++number, surface, places.empty() ? nullptr : &cuts); !s)
      return Error{ErrorCode::BadFile,
                   name + ":" + std::to_string(face.line) + ": " + s.error().message};
  add_texture(faces, cuts, places, name, surface);
  parts.say(surface.left_out);
  if (skipped > 0)
    surface.left_out.push_back("left out " + std::to_string(skipped) + " points and lines");
  return surface;
}

}  // namespace trocar::formats
