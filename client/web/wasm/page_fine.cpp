#include "client/web/wasm/page_fine.h"

#include <algorithm>
#include <utility>

#include "client/embedding/fine_shape.h"
#include "client/shape/blood_film.h"
#include "common/wire/picture_size.h"
#include "proto/fine_surface.pb.h"
#include "proto/wire.pb.h"

namespace trocar::wasm {
namespace {

constexpr std::size_t kMostWholeBytes = std::size_t{wire::kMaxFineParts} * wire::kFinePartBytes;

}  // namespace

Bytes4 bytes_of(const PageTint& tint) {
  const auto byte = [](float value) {
    return static_cast<std::uint8_t>(std::clamp(value, 0.0f, 1.0f) * 255);
  };
  const float whole = tint.a > 1e-3f ? 1 / tint.a : 0.0f;
  return {byte(tint.r * whole), byte(tint.g * whole), byte(tint.b * whole), byte(tint.a)};
}

void PageFine::restart() {
  const auto geometry = geometry_version_, motion = motion_version_, picture = picture_version_;
  *this = {};
  geometry_version_ = geometry + 1;  // never one that was shown
  motion_version_ = motion + 1;
  picture_version_ = picture + 1;
}

void PageFine::refuse(const std::string& why) {
  restart();
  fault_ = "the organ is drawn without its fine surface: " + why;
}

void PageFine::take(const proto::FineSurfacePart& part) {
  const auto is_whole = parts_.add(part);
  if (!is_whole.ok()) return refuse(is_whole.error().message);
  if (*is_whole) show(parts_.take());
}

void PageFine::take_whole(BytesView message) {
  proto::FineSurface parsed;
  if (message.size() > kMostWholeBytes) return refuse("FineSurface: more than 16 MiB");
  if (!parsed.ParseFromArray(message.data(), static_cast<int>(message.size())))
    return refuse("FineSurface: is malformed");
  auto surface = wire::read(parsed);
  if (!surface.ok()) return refuse(surface.error().message);
  show(std::move(*surface));
}

void PageFine::show(wire::FineSurface surface) {
  std::string picture = std::exchange(surface.picture, {});
  // Who comes back is sent the same again.
  if (surface_ && surface == source_ && picture == picture_) return;
  restart();
  if (surface.empty()) return;
  if (!picture.empty()) {
    const auto size = wire::picture_size(picture);
    if (!size)
      fault_ = "the organ is drawn without its picture: the header of that is broken";
    else if (std::max((*size)[0], (*size)[1]) > wire::kMostFinePictureSide)
      fault_ = "the organ is drawn without its picture: that has " + std::to_string((*size)[0]) +
               " x " + std::to_string((*size)[1]) + " pixels, may have 2,048 to a side";
    else
      picture_ = std::move(picture);
  }
  surface_.emplace(embedding::shape_of(surface));
  source_ = std::move(surface);
}

void PageFine::follow(const embedding::CoarseShape& coarse, std::uint64_t topology_version) {
  if (!surface_ || topology_version == topology_version_) return;
  topology_version_ = topology_version;
  surface_->follow(coarse);
  ++geometry_version_;
  rest_.clear();
  texture_.clear();
  for (const auto& look : surface_->looks()) {
    rest_.push_back({look.rest.x, look.rest.y, look.rest.z, look.rim});
    texture_.push_back(look.texture);
  }
}

void PageFine::update(std::span<const Vec3f> positions, std::span<const PageTint> tints,
                      std::span<const float> blood) {
  if (!surface_) return;
  surface_->update(positions);
  const std::size_t vertices = surface_->vertex_count();
  if (surface_->moved_count() == 0 && lips_.size() == vertices &&
      std::ranges::equal(tints, coarse_tints_) && std::ranges::equal(blood, coarse_blood_))
    return;
  ++motion_version_;
  coarse_tints_.assign(tints.begin(), tints.end());
  coarse_blood_.assign(blood.begin(), blood.end());
  surface_->spread(tints, tints_);
  surface_->spread(blood, blood_);
  lips_.resize(vertices);
  overlay_.resize(vertices);
  for (std::size_t i = 0; i < vertices; ++i) {
    lips_[i] = shape::lip_bytes(surface_->normals()[i], blood_[i]);
    overlay_[i] = bytes_of(tints_[i]);
  }
}

}  // namespace trocar::wasm
