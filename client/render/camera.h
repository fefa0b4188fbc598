#pragma once

// Orbit camera and the 4x4 matrices OpenGL wants.

#include <array>
#include <optional>
#include <span>

#include "client/device/view_rays.h"
#include "client/render/gl_context.h"
#include "client/shape/lens.h"
#include "client/shape/smooth_surface.h"
#include "common/math/frame.h"
#include "common/math/vec3.h"

namespace trocar::render {

using shape::Lens;

using Matrix4 = std::array<float, 16>;  // column by column

struct ScreenPoint {
  float x = 0, y = 0;  // pixels, origin top left
};

class OrbitCamera {
 public:
  // Looks at the centre of a body of this radius (m) from the front, a little from above.
  void frame(const Vec3f& centre, float radius);
  // Right drag orbits, middle drag pans, Ctrl + wheel and the zoom keys zoom about `focus`; without
  // one about the centre.
  void update(const device::PointerInput& input, Size size, float seconds,
              const std::optional<Vec3f>& focus = {});
  void orbit(float yaw, float pitch);  // rad
  void zoom(float factor);
  // A place that stays where it is in the picture.
  void zoom_about(const Vec3f& focus, float factor);
  // Turns about this place from here on, and has it in the middle.
  void aim_at(const Vec3f& place) { centre_ = place; }
  // Stands at `eye` and turns about `target`, as far as this camera can: its up is up.
  void look(const Vec3f& eye, const Vec3f& target);
  // Stands to its body as `other` stands to the other's, in proportion to their sizes.
  void stand_as(const OrbitCamera& other);
  const Vec3f& centre() const { return centre_; }
  // Sees as this lens does, until told otherwise; without one from where the orbit is.
  void look_through(const std::optional<Lens>& lens) { lens_ = lens; }
  const std::optional<Lens>& lens() const { return lens_; }
  // Steps back out of tissue, and lets the near plane cut none of it away. This holds until the
  // camera is moved: call it for each picture. Surface: as of shape::clear_eye; empty: there is
  // none.
  void keep_clear(std::span<const Vec3f> positions,
                  std::span<const shape::TriangleCorners> triangles, Size size);

  device::ViewRays rays(Size size) const;
  // World from camera: x to the right of the screen, y up, z towards the person.
  Quatf orientation() const;
  Matrix4 clip_from_world(Size size) const;
  std::optional<ScreenPoint> project(const Vec3f& world, Size size) const;  // none behind the eye

 private:
  float near_m(Size size) const;

  Vec3f centre_, body_;  // that it turns about, and of the body
  float radius_ = 0.12f;
  float yaw_ = 0, pitch_ = 0.42f, distance_ = 0.5f;
  std::optional<Lens> lens_;
  float back_ = 0;                // m, that it steps back
  std::optional<float> nearest_;  // m, of tissue; none: nothing is near
};

Matrix4 multiply(const Matrix4& a, const Matrix4& b);

}  // namespace trocar::render
