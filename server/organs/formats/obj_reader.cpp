#include "server/organs/formats/obj_reader.h"

#include <algorithm>
#include <vector>

#include "server/organs/formats/polygon.h"
#include "server/organs/formats/text_reader.h"

namespace trocar::formats {
namespace {

constexpr std::string_view kSkippedKeywords[] = {
    "vn", "vt", "vp", "g", "o", "s", "mtllib", "usemtl", "l", "p", "usemap", "maplib", "lod"};

// Each face is kept until all vertices are known: it may refer to later ones.
struct ObjFace {
  std::vector<std::int64_t> corners;  // from 0
  int line = 0;
};

// "7", "7/1", "7//3" or "7/1/3"; numbers below 0 count back from the last vertex.
Status read_corner(const TextReader& in, std::string_view word, std::size_t vertices, ObjFace& face,
                   std::size_t face_number) {
  std::int64_t number = 0;
  if (!parse_whole(word.substr(0, word.find('/')), number) || number == 0)
    return in.error("face " + std::to_string(face_number) + " refers to vertex " + shown(word) +
                    ", must be a whole number other than 0");
  face.corners.push_back(number > 0 ? number - 1 : static_cast<std::int64_t>(vertices) + number);
  return {};
}

}  // namespace

Result<surface::RawSurface> parse_obj(std::string_view text, const std::string& name) {
  TextReader in(text, name, '#');
  surface::RawSurface surface;
  std::vector<ObjFace> faces;
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
    } else if (keyword == "f") {
      ObjFace face{{}, in.line_number()};
      for (auto word = in.word(); !word.empty(); word = in.word())
        if (auto s = read_corner(in, word, surface.positions.size(), face, faces.size() + 1); !s)
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
  return surface;
}

}  // namespace trocar::formats
