#include "common/wire/fine_surface.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "proto/fine_surface.pb.h"
#include "proto/wire.pb.h"

namespace trocar::wire {
namespace {

Error wrong(const std::string& what) {
  return {ErrorCode::BadMessage, "FineSurface." + what};
}

// The numbers of a field are differences: each to the one `stride` before it. They wrap around
// where a message is wrong; every value is compared with its limit.
template <typename Field>
std::int32_t add_step(const Field& field, int i, std::int32_t before) {
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(before) +
                                   static_cast<std::uint32_t>(field.Get(i)));
}

Error wrong_part(const std::string& what) {
  return {ErrorCode::BadMessage, "FineSurfacePart." + what};
}

bool is_picture(const std::string& file) {
  return file.starts_with("\x89PNG\r\n\x1a\n") || file.starts_with("\xff\xd8\xff");
}

}  // namespace

Vec3f FineSurface::position_m(std::size_t vertex) const {
  const auto& [x, y, z] = quanta[vertex];
  return to_float(Vec3d{double(x), double(y), double(z)} * kFineQuantumMetres);
}

std::array<std::int32_t, 3> fine_quanta(const Vec3d& position_m) {
  const auto quantum = [](double m) {
    return static_cast<std::int32_t>(std::lround(m / kFineQuantumMetres));
  };
  return {quantum(position_m.x), quantum(position_m.y), quantum(position_m.z)};
}

Status validate(const FineSurface& surface) {
  if (surface.quanta.size() > kMaxFineVertices)
    return wrong("position_step: " + std::to_string(surface.quanta.size()) +
                 " vertices, at most 300,000");
  if (surface.triangles.size() > kMaxFineTriangles)
    return wrong("corner_step: " + std::to_string(surface.triangles.size()) +
                 " triangles, at most 200,000");
  if (surface.triangles.empty() && !(surface.quanta.empty() && surface.picture.empty()))
    return wrong("corner_step: there is no triangle");
  for (const auto& place : surface.quanta)
    for (const std::int32_t c : place)
      if (c < -kMaxFineQuanta || c > kMaxFineQuanta)
        return wrong("position_step: a vertex is more than 2 m from the origin");
  for (const auto& [a, b, c] : surface.triangles) {
    if (std::max({a, b, c}) >= surface.quanta.size())
      return wrong("corner_step: vertex out of range");
    if (a == b || b == c || c == a) return wrong("corner_step: a triangle has a corner twice");
  }
  if (!surface.texture.empty() && surface.texture.size() != surface.quanta.size())
    return wrong("texture_step: not two numbers per vertex");
  for (const auto& place : surface.texture)
    for (const std::int32_t c : place)
      if (c < -kMaxTextureQuanta || c > kMaxTextureQuanta)
        return wrong("texture_step: beyond 16 times the picture");
  if (surface.picture.size() > kMaxFinePictureBytes) return wrong("picture: more than 4 MiB");
  if (surface.picture.empty()) return {};
  if (!is_picture(surface.picture)) return wrong("picture: neither PNG nor JPEG");
  if (surface.texture.empty()) return wrong("picture: there are no texture coordinates for it");
  return {};
}

void write(const FineSurface& surface, proto::FineSurface& message) {
  std::array<std::int32_t, 3> before{};
  message.mutable_position_step()->Reserve(static_cast<int>(3 * surface.quanta.size()));
  for (const auto& place : surface.quanta) {
    for (std::size_t axis = 0; axis < 3; ++axis)
      message.add_position_step(place[axis] - before[axis]);
    before = place;
  }
  std::uint32_t last = 0;
  message.mutable_corner_step()->Reserve(static_cast<int>(3 * surface.triangles.size()));
  for (const auto& triangle : surface.triangles)
    for (const std::uint32_t corner : triangle) {
      message.add_corner_step(static_cast<std::int32_t>(corner - last));
      last = corner;
    }
  std::array<std::int32_t, 2> at{};
  for (const auto& place : surface.texture) {
    for (std::size_t axis = 0; axis < 2; ++axis) message.add_texture_step(place[axis] - at[axis]);
    at = place;
  }
  message.set_picture(surface.picture);
}

Result<FineSurface> read(const proto::FineSurface& message) {
  const auto& positions = message.position_step();
  const auto& corners = message.corner_step();
  const auto& texture = message.texture_step();
  if (positions.size() % 3 != 0) return wrong("position_step: not three numbers per vertex");
  if (corners.size() % 3 != 0) return wrong("corner_step: not three corners per triangle");
  if (texture.size() % 2 != 0) return wrong("texture_step: not two numbers per vertex");
  if (static_cast<std::size_t>(positions.size()) > 3 * kMaxFineVertices)
    return wrong("position_step: more than 300,000 vertices");
  if (static_cast<std::size_t>(corners.size()) > 3 * kMaxFineTriangles)
    return wrong("corner_step: more than 200,000 triangles");
  if (static_cast<std::size_t>(texture.size()) > 2 * kMaxFineVertices)
    return wrong("texture_step: more than 300,000 vertices");
  FineSurface surface;
  surface.quanta.reserve(static_cast<std::size_t>(positions.size() / 3));
  std::array<std::int32_t, 3> place{};
  for (int i = 0; i < positions.size(); i += 3) {
    for (int axis = 0; axis < 3; ++axis) {
      std::int32_t& c = place[static_cast<std::size_t>(axis)];
      c = add_step(positions, i + axis, c);
    }
    surface.quanta.push_back(place);
  }
  std::int32_t corner = 0;
  surface.triangles.resize(static_cast<std::size_t>(corners.size() / 3));
  for (int i = 0; i < corners.size(); ++i) {
    corner = add_step(corners, i, corner);
    const auto at = static_cast<std::size_t>(i);
    surface.triangles[at / 3][at % 3] = static_cast<std::uint32_t>(corner);
  }
  std::array<std::int32_t, 2> uv{};
  for (int i = 0; i < texture.size(); i += 2) {
    uv = {add_step(texture, i, uv[0]), add_step(texture, i + 1, uv[1])};
    surface.texture.push_back(uv);
  }
  surface.picture = message.picture();
  if (Status valid = validate(surface); !valid.ok()) return valid.error();
  return surface;
}

std::vector<proto::FineSurfacePart> parts_of(const FineSurface& surface) {
  if (surface.empty()) return {};
  proto::FineSurface message;
  write(surface, message);
  const std::string bytes = message.SerializeAsString();
  std::vector<proto::FineSurfacePart> parts((bytes.size() + kFinePartBytes - 1) / kFinePartBytes);
  for (std::size_t i = 0; i < parts.size(); ++i) {
    parts[i].set_part(static_cast<std::uint32_t>(i));
    parts[i].set_parts(static_cast<std::uint32_t>(parts.size()));
    parts[i].set_payload(bytes.substr(i * kFinePartBytes, kFinePartBytes));
  }
  return parts;
}

Result<bool> FinePartOrder::add(const proto::FineSurfacePart& part) {
  if (part.parts() == 0 || part.parts() > kMaxFineParts)
    return wrong_part("parts: " + std::to_string(part.parts()) + " must be 1 to 512");
  if (part.payload().empty() || part.payload().size() > kFinePartBytes)
    return wrong_part("payload: must have 1 to 32,768 bytes");
  if (part.part() == 0) {
    next_ = 0;
    parts_ = part.parts();
  }
  if (part.part() != next_ || part.parts() != parts_)
    return wrong_part("part: " + std::to_string(part.part()) + " of " +
                      std::to_string(part.parts()) + " does not follow");
  if (++next_ < parts_) return false;
  next_ = parts_ = 0;
  return true;
}

Result<bool> FineSurfaceAssembler::add(const proto::FineSurfacePart& part) {
  const auto is_last = order_.add(part);
  if (!is_last.ok()) return is_last;
  if (part.part() == 0) bytes_.clear();
  bytes_ += part.payload();
  if (!*is_last) return false;
  proto::FineSurface message;
  const bool is_parsed = message.ParseFromString(bytes_);
  bytes_ = {};
  if (!is_parsed) return wrong_part("payload: is malformed");
  auto surface = read(message);
  if (!surface) return surface.error();
  surface_ = std::move(*surface);
  return true;
}

FineSurface FineSurfaceAssembler::take() {
  return std::exchange(surface_, {});
}

}  // namespace trocar::wire
