#include "server/organs/formats/polygon.h"

namespace trocar::formats {

Status add_polygon(std::span<const std::int64_t> corners, std::int64_t number,
                   surface::RawSurface& surface) {
  const std::string face = "face " + std::to_string(number);
  if (corners.size() < 3)
    return Error{ErrorCode::BadFile,
                 face + " has " + std::to_string(corners.size()) + " corners, must have 3 or more"};
  const auto count = static_cast<std::int64_t>(surface.positions.size());
  for (const std::int64_t corner : corners)
    if (corner < 0 || corner >= count)
      return Error{ErrorCode::BadFile, face + " refers to vertex " + std::to_string(corner + 1) +
                                           ", the file has " + std::to_string(count)};
  const auto node = [&](std::size_t i) {
    return NodeIndex(static_cast<std::uint32_t>(corners[i]));
  };
  for (std::size_t i = 2; i < corners.size(); ++i) {
    surface.triangles.push_back({node(0), node(i - 1), node(i)});
    surface.face_numbers.push_back(number);
  }
  return {};
}

}  // namespace trocar::formats
