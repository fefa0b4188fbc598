#pragma once

// Messages for peers, packed by OpenIGTLink's own library, with a header of version 1, which every
// peer reads. Device names have at most kMostNameBytes bytes; the library cuts longer ones. Thread:
// the caller's, one for all.

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "client/slicer/frames.h"
#include "common/wire/framing.h"

namespace trocar::slicer {

using wire::SharedBytes;

inline constexpr std::size_t kMostNameBytes = 20;

enum class Condition : std::uint8_t { Fine, NotReady, Busy, Refused, Over };

SharedBytes transform_message(const std::string& device, const Transform& transform);
SharedBytes text_message(const std::string& device, const std::string& text);
SharedBytes status_message(const std::string& device, Condition condition, const std::string& text);
// Newtons along R, A and S.
SharedBytes force_message(const std::string& device, const Vec3f& ras_n);

struct SurfaceView {
  std::span<const Vec3f> points_mm;  // RAS
  // Those with equal corners are left out.
  std::span<const std::array<std::uint32_t, 3>> triangles;
  std::span<const std::uint8_t> is_wound;  // per triangle
};
// Its points have the scalar "wound": 1 on triangles that a blade has made, else 0.
SharedBytes surface_message(const std::string& device, const SurfaceView& surface);

}  // namespace trocar::slicer
