#pragma once

// How the screen lies in the world: what a pointing device needs from a camera.

#include <algorithm>
#include <array>

#include "common/math/vec3.h"

namespace trocar::device {

struct ViewRays {
  Vec3f eye;                          // m, world frame
  Vec3f right{1, 0, 0}, up{0, 1, 0};  // unit
  Vec3f forward{0, 0, -1};            // unit, into the screen
  float tan_half_height = 0.3f;       // tangent of half the vertical field of view
  float width = 1, height = 1;        // pixels

  // Through a pixel, not normalised: one metre of depth along `forward` per unit.
  Vec3f ray_through(float x, float y) const {
    const float u = (2 * x / width - 1) * tan_half_height * width / height;
    const float v = (1 - 2 * y / height) * tan_half_height;
    return forward + right * u + up * v;
  }
  // Returns where a point before the eye is seen, in pixels.
  std::array<float, 2> pixel_of(const Vec3f& point) const {
    const Vec3f to = point - eye;
    const float depth = std::max(dot(to, forward), 1e-4f);
    const float u = dot(to, right) / depth, v = dot(to, up) / depth;
    return {(u * height / (tan_half_height * width) + 1) * width / 2,
            (1 - v / tan_half_height) * height / 2};
  }
};

// A person's mouse and keyboard are read into this once per display frame.
struct PointerInput {
  float x = 0, y = 0;                                // pixels, origin top left
  float dx = 0, dy = 0;                              // since the frame before
  float wheel = 0;                                   // notches, away from the person positive
  bool is_over_scene = true;                         // not over a panel, inside the window
  bool left = false, right = false, middle = false;  // buttons held
  bool control = false, shift = false;
  bool push = false, grasp = false, cut = false;  // keys held
  bool deeper = false, nearer = false;
  bool roll_left = false, roll_right = false;
  bool zoom_in = false, zoom_out = false;
};

}  // namespace trocar::device
