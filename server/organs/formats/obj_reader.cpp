#include "server/organs/formats/obj_reader.h"

#include <algorithm>
#include <array>
#include <vector>

#include "server/organs/formats/polygon.h"
#include "server/organs/formats/text_reader.h"

namespace trocar::formats {
namespace {

constexpr std::string_view kSkippedKeywords[] = {"vn",     "vp", "g", "o",      "s",      "mtllib",
                                                 "usemtl", "l",  "p", "usemap", "maplib", "lod"};

// Each face is kept until all vertices are known: it may refer to later ones.
struct ObjFace {
  std::vector<std::int64_t> corners;  // from 0
  std::vector<std::int64_t> texture;  // likewise, one for each corner; -1: none
  int line = 0;
};

// A number below 0 counts back from the last one there is. False: it is none.
bool read_number(std::string_view word, std::size_t count, std::int64_t& number) {
  if (!parse_whole(word, number) || number == 0) return false;
  number = number > 0 ? number - 1 : static_cast<std::int64_t>(count) + number;
  return true;
}

// "7", "7/1", "7//3" or "7/1/3"; numbers below 0 count back from the last vertex.
Status read_corner(const TextReader& in, std::string_view word, std::size_t vertices,
                   std::size_t places, ObjFace& face, std::size_t face_number) {
  std::int64_t number = 0, place = -1;
  const auto slash = word.find('/');
  if (!read_number(word.substr(0, slash), vertices, number))
    return in.error("face " + std::to_string(face_number) + " refers to vertex " + shown(word) +
                    ", must be a whole number other than 0");
  if (slash != std::string_view::npos) {
    const auto rest = word.substr(slash + 1);
    const auto text = rest.substr(0, rest.find('/'));
    if (!text.empty() && !read_number(text, places, place))
      return in.error("face " + std::to_string(face_number) + " refers to texture coordinate " +
                      shown(text) + ", must be a whole number other than 0");
  }
  face.corners.push_back(number);
  face.texture.push_back(place);
  return {};
}

// Gives each triangle its corners' places, if all faces have them.
Status add_texture(const std::vector<ObjFace>& faces,
                   const std::vector<std::array<double, 2>>& places, const std::string& name,
                   surface::RawSurface& surface) {
  for (const ObjFace& face : faces)
    for (const std::int64_t place : face.texture) {
      if (place == -1 && places.empty()) return {};
      if (place < -1 || place >= static_cast<std::int64_t>(places.size()))
        return Error{ErrorCode::BadFile, name + ":" + std::to_string(face.line) +
                                             ": refers to texture coordinate " +
                                             std::to_string(place + 1) + ", the file has " +
                                             std::to_string(places.size())};
      if (place == -1) return {};
    }
  if (places.empty()) return {};
  for (const ObjFace& face : faces)
    for (std::size_t i = 2; i < face.texture.size(); ++i) {
      const auto at = [&](std::size_t corner) {
        return places[static_cast<std::size_t>(face.texture[corner])];
      };
      surface.corner_texture.push_back({at(0), at(i - 1), at(i)});
    }
  return {};
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
      auto& place = places.emplace_back();
      if (!parse_finite(in.word(), place[0]))
        return in.error("texture coordinate " + std::to_string(places.size()) +
                        ": is not a finite number");
      // A picture of one dimension has u alone.
      if (const auto v = in.word(); !v.empty() && !parse_finite(v, place[1]))
        return in.error("texture coordinate " + std::to_string(places.size()) + ": " + shown(v) +
                        " is not a finite number");
    } else if (keyword == "f") {
      ObjFace face{{}, {}, in.line_number()};
      for (auto word = in.word(); !word.empty(); word = in.word())
        if (auto s = read_corner(in, word, surface.positions.size(), places.size(), face,
                                 faces.size() + 1);
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
  if (auto s = add_texture(faces, places, name, surface); !s) return s.error();
  return surface;
}

}  // namespace trocar::formats
