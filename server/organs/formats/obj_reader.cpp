#include "server/organs/formats/obj_reader.h"

#include <algorithm>
#include <array>
#include <optional>
#include <vector>

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

// A number below 0 counts back from the last one there is. False: it is none.
bool read_number(std::string_view word, std::size_t count, std::int64_t& number) {
  if (!parse_whole(word, number) || number == 0) return false;
  number = number > 0 ? number - 1 : static_cast<std::int64_t>(count) + number;
  return true;
}

// "7", "7/1", "7//3" or "7/1/3"; numbers below 0 count back from the last vertex. What is wrong in
// a place in a picture is kept in `fault`, the first time.
Status read_corner(const TextReader& in, std::string_view word, std::size_t vertices,
                   std::size_t places, ObjFace& face, std::size_t face_number, std::string& fault) {
  std::int64_t number = 0;
  std::optional<std::int64_t> place;
  const auto slash = word.find('/');
  if (!read_number(word.substr(0, slash), vertices, number))
    return in.error("face " + std::to_string(face_number) + " refers to vertex " + shown(word) +
                    ", must be a whole number other than 0");
  if (slash != std::string_view::npos) {
    const auto rest = word.substr(slash + 1);
    const auto text = rest.substr(0, rest.find('/'));
    if (std::int64_t read = 0; read_number(text, places, read))
      place = read;
    else if (!text.empty() && fault.empty())
      fault = in.error("face " + std::to_string(face_number) + " refers to texture coordinate " +
                       shown(text) + ", must be a whole number other than 0")
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

// Gives each triangle its corners' places, if all faces have them and none is wrong.
void add_texture(const std::vector<ObjFace>& faces,
                 const std::vector<std::array<double, 2>>& places, const std::string& name,
                 surface::RawSurface& surface) {
  if (!surface.texture_fault.empty()) return;
  for (const ObjFace& face : faces)
    for (const auto& place : face.texture) {
      if (!place) return;
      if (*place >= 0 && *place < static_cast<std::int64_t>(places.size())) continue;
      surface.texture_fault = name + ":" + std::to_string(face.line) +
                              ": refers to texture coordinate " + std::to_string(*place + 1) +
                              ", the file has " + std::to_string(places.size());
      return;
    }
  for (const ObjFace& face : faces)
    for (std::size_t i = 2; i < face.texture.size(); ++i) {
      const auto at = [&](std::size_t corner) {
        return places[static_cast<std::size_t>(*face.texture[corner])];
      };
      surface.corner_texture.push_back({at(0), at(i - 1), at(i)});
    }
}

}  // namespace

Result<surface::RawSurface> parse_obj(std::string_view text, const std::string& name) {
  TextReader in(text, name, '#');
  surface::RawSurface surface;
  std::vector<ObjFace> faces;
  std::vector<std::array<double, 2>> places;  // in a picture
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
    }
  }
  std::int64_t number = 0;
  for (const ObjFace& face : faces)
    if (auto s = add_polygon(face.corners, ++number, surface); !s)
      return Error{ErrorCode::BadFile,
                   name + ":" + std::to_string(face.line) + ": " + s.error().message};
  add_texture(faces, places, name, surface);
  return surface;
}

}  // namespace trocar::formats
