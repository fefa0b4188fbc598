#include "client/render/camera.h"

#include <algorithm>
#include <cmath>

#include "client/shape/clear_eye.h"

namespace trocar::render {
namespace {

constexpr float kTanHalfHeight = 0.2867f;  // 32 degrees of vertical field of view
constexpr float kNear = 0.02f, kLensNear = 0.003f, kFar = 6.0f;
constexpr float kOrbitPerPixel = 0.006f;
constexpr float kNearestRadii = 0.06f;  // of the body, from what it turns about

}  // namespace

void OrbitCamera::frame(const Vec3f& centre, float radius) {
  centre_ = body_ = centre;
  radius_ = radius;
  yaw_ = 0;
  pitch_ = 0.42f;
  distance_ = radius / kTanHalfHeight * 0.90f;
}

void OrbitCamera::orbit(float yaw, float pitch) {
  yaw_ += yaw;
  pitch_ = std::clamp(pitch_ + pitch, -1.5f, 1.5f);
}

void OrbitCamera::zoom(float factor) {
  distance_ = std::clamp(distance_ * factor, radius_ * kNearestRadii, radius_ * 12);
}

void OrbitCamera::zoom_about(const Vec3f& focus, float factor) {
  const float before = distance_;
  zoom(factor);
  const Vec3f centre = focus + (centre_ - focus) * (distance_ / before);
  // Whoever zooms out beside the body, again and again, still has it in the picture.
  const Vec3f off = centre - body_;
  const float far = length(off);
  centre_ = far > radius_ ? body_ + off * (radius_ / far) : centre;
}

void OrbitCamera::look(const Vec3f& eye, const Vec3f& target) {
  const Vec3f back = eye - target;
  centre_ = target;
  distance_ = std::clamp(length(back), radius_ * kNearestRadii, radius_ * 40);
  yaw_ = std::atan2(back.x, back.z);
  pitch_ = std::clamp(std::atan2(back.y, std::hypot(back.x, back.z)), -1.5f, 1.5f);
}

void OrbitCamera::stand_as(const OrbitCamera& other) {
  const float size = radius_ / other.radius_;
  yaw_ = other.yaw_;
  pitch_ = other.pitch_;
  distance_ = other.distance_ * size;
  centre_ = body_ + (other.centre_ - other.body_) * size;
}

void OrbitCamera::update(const device::PointerInput& input, Size size, float seconds,
                         const std::optional<Vec3f>& focus) {
  if (input.right) orbit(-input.dx * kOrbitPerPixel, input.dy * kOrbitPerPixel);
  if (input.middle) {
    const device::ViewRays view = rays(size);
    const float metres = 2 * kTanHalfHeight * distance_ / view.height;
    centre_ += view.right * (-input.dx * metres) + view.up * (input.dy * metres);
  }
  float factor = 1;
  if (input.control && input.wheel != 0) factor = std::pow(0.9f, input.wheel);
  if (input.zoom_in != input.zoom_out) factor *= std::exp((input.zoom_in ? -1.0f : 1.0f) * seconds);
  if (factor != 1) zoom_about(focus.value_or(centre_), factor);
}

void OrbitCamera::keep_clear(std::span<const Vec3f> positions,
                             std::span<const shape::TriangleCorners> triangles, Size size) {
  back_ = 0;
  const device::ViewRays view = rays(size);
  const auto clear = shape::clear_eye(view.eye, view.forward, positions, triangles,
                                      lens_ ? shape::kScopeClearMetres : shape::kClearMetres);
  back_ = clear.back_m;
  nearest_ = clear.nearest_m;
}

float OrbitCamera::near_m(Size size) const {
  const float usual = lens_ ? kLensNear : kNear;
  if (!nearest_) return usual;
  const device::ViewRays view = rays(size);
  return std::min(usual,
                  shape::near_plane(*nearest_, view.tan_half_height, view.width / view.height));
}

device::ViewRays OrbitCamera::rays(Size size) const {
  device::ViewRays view;
  view.width = static_cast<float>(std::max(size.width, 1));
  view.height = static_cast<float>(std::max(size.height, 1));
  if (lens_) {
    view.eye = lens_->eye - lens_->forward * back_;
    view.forward = lens_->forward;
    view.up = lens_->up;
    view.right = cross(view.forward, view.up);
    view.tan_half_height = lens_->tan_half_height;
    return view;
  }
  view.forward = Vec3f{-std::sin(yaw_) * std::cos(pitch_), -std::sin(pitch_),
                       -std::cos(yaw_) * std::cos(pitch_)};
  view.right = {std::cos(yaw_), 0, -std::sin(yaw_)};
  view.up = cross(view.right, view.forward);
  view.eye = centre_ - view.forward * (distance_ + back_);
  view.tan_half_height = kTanHalfHeight;
  return view;
}

Quatf OrbitCamera::orientation() const {
  if (lens_) {
    const Quatf back = rotation_from_z(-lens_->forward);
    const Vec3f right = cross(lens_->forward, lens_->up);
    const float turn =
        0.5f * std::atan2(dot(right, rotate(back, {0, 1, 0})), dot(right, rotate(back, {1, 0, 0})));
    return back * Quatf{0, 0, std::sin(turn), std::cos(turn)};
  }
  const Quatf yaw{0, std::sin(yaw_ / 2), 0, std::cos(yaw_ / 2)};
  const Quatf pitch{std::sin(-pitch_ / 2), 0, 0, std::cos(pitch_ / 2)};
  return yaw * pitch;
}

Matrix4 OrbitCamera::clip_from_world(Size size) const {
  const device::ViewRays v = rays(size);
  const Matrix4 eye_from_world = {v.right.x,
                                  v.up.x,
                                  -v.forward.x,
                                  0,
                                  v.right.y,
                                  v.up.y,
                                  -v.forward.y,
                                  0,
                                  v.right.z,
                                  v.up.z,
                                  -v.forward.z,
                                  0,
                                  -dot(v.right, v.eye),
                                  -dot(v.up, v.eye),
                                  dot(v.forward, v.eye),
                                  1};
  const float f = 1 / v.tan_half_height, near = near_m(size);
  const Matrix4 clip_from_eye = {f * v.height / v.width,
                                 0,
                                 0,
                                 0,
                                 0,
                                 f,
                                 0,
                                 0,
                                 0,
                                 0,
                                 (kFar + near) / (near - kFar),
                                 -1,
                                 0,
                                 0,
                                 2 * kFar * near / (near - kFar),
                                 0};
  return multiply(clip_from_eye, eye_from_world);
}

std::optional<ScreenPoint> OrbitCamera::project(const Vec3f& world, Size size) const {
  const device::ViewRays v = rays(size);
  const Vec3f p = world - v.eye;
  const float depth = dot(p, v.forward);
  if (depth < near_m(size)) return std::nullopt;
  const float scale = v.height / (2 * v.tan_half_height * depth);
  return ScreenPoint{v.width / 2 + dot(p, v.right) * scale, v.height / 2 - dot(p, v.up) * scale};
}

Matrix4 multiply(const Matrix4& a, const Matrix4& b) {
  Matrix4 product{};
  for (std::size_t column = 0; column < 4; ++column)
    for (std::size_t row = 0; row < 4; ++row)
      for (std::size_t k = 0; k < 4; ++k)
        product[column * 4 + row] += a[k * 4 + row] * b[column * 4 + k];
  return product;
}

}  // namespace trocar::render
