#include "server/session/recording/stored_surface.h"

#include <fmt/format.h>

#include "common/wire/surface_codec.h"
#include "common/wire/surface_messages.h"
#include "proto/wire.pb.h"

namespace trocar::recording {

StoredSurface::Check StoredSurface::check(const proto::SurfaceTopology& message) {
  auto layout = wire::read(message);
  if (!layout.ok()) return StoredDifference{"topology", layout.error().message, "a surface"};
  layout_ = std::move(*layout);
  has_layout_ = true;
  return {};
}

StoredSurface::Check StoredSurface::check(const proto::SurfaceChange& message) {
  if (!has_layout_ || message.from_epoch() != layout_.epoch) {
    has_layout_ = has_surface_ = false;
    return {};
  }
  const auto change = wire::read(message, layout_);
  const Status applied = change.ok() ? wire::apply(*change, layout_) : Status(change.error());
  if (applied.ok()) return {};
  return StoredDifference{"change", applied.error().message, "a change that fits the surface"};
}

StoredSurface::Check StoredSurface::check(const proto::SurfaceFrame& message) {
  const bool is_key = message.is_keyframe();
  const bool has_base = is_key || (has_surface_ && message.base_frame() == frame_);
  has_surface_ = has_base && has_layout_ && message.epoch() == layout_.epoch;
  if (!has_surface_) {
    ++undecodable_;
    return {};
  }
  surface_.resize(layout_.vertex_count());  // new vertices count as zero in the baseline
  const auto payload = bytes_of(std::string_view(message.payload()));
  const Status decoded =
      is_key ? wire::decode_keyframe(payload, surface_) : wire::decode_delta(payload, surface_);
  if (!decoded.ok()) return StoredDifference{"payload", decoded.error().message, "a surface"};
  frame_ = message.frame();
  ++decoded_;
  const auto crc = wire::surface_crc(surface_);
  if (crc == message.surface_crc()) return check_blood(message);
  return StoredDifference{"surface_crc", fmt::format("{:08x}", message.surface_crc()),
                          fmt::format("{:08x}", crc)};
}

StoredSurface::Check StoredSurface::check_blood(const proto::SurfaceFrame& message) {
  if (!message.has_blood()) {
    blood_.clear();
    return {};
  }
  if (message.is_keyframe()) blood_.clear();
  blood_.resize(surface_.size(), 0);
  const Status decoded = wire::decode_blood(bytes_of(std::string_view(message.blood())), blood_);
  if (!decoded.ok()) return StoredDifference{"blood", decoded.error().message, "levels"};
  ++bled_;
  const auto crc = wire::blood_crc(blood_);
  if (crc == message.blood_crc()) return {};
  return StoredDifference{"blood_crc", fmt::format("{:08x}", message.blood_crc()),
                          fmt::format("{:08x}", crc)};
}

}  // namespace trocar::recording
