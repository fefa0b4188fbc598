#include "client/doctor/machine.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include "client/device/device_list.h"
#include "client/render/camera.h"
#include "client/render/gl_context.h"
#include "client/render/scene_renderer.h"
#include "common/base/timing.h"

namespace trocar::doctor {
namespace {

constexpr render::Size kSize{1280, 720};
constexpr int kPicturesAtOnce = 4;  // before the renderer is waited for

bool has_display() {
  const auto is_set = [](const char* name) {
    const char* value = std::getenv(name);
    return value != nullptr && *value != '\0';
  };
  return is_set("DISPLAY") || is_set("WAYLAND_DISPLAY");
}

render::OrbitCamera camera_on(const std::vector<Vec3f>& points) {
  Vec3f low = points.front(), high = low;
  for (const Vec3f& p : points) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  render::OrbitCamera camera;
  camera.frame((low + high) * 0.5f, length(high - low) * 0.5f);
  return camera;
}

}  // namespace

Graphics measure_graphics(const Visited& visited, double seconds) {
  Graphics graphics;
  graphics.has_display = has_display();
  auto context = render::make_headless_context(kSize);
  if (!context) {
    graphics.problem = context.error().message;
    return graphics;
  }
  graphics.renderer = (*context)->renderer_name();
  graphics.is_software = (*context)->is_software();
  if (!visited.replica || !visited.surface.is_valid()) return graphics;
  const auto& topology = visited.replica->topology();
  if (topology.rest_positions.empty() ||
      visited.surface.positions().size() != topology.rest_positions.size())
    return graphics;
  render::SceneRenderer renderer(**context);
  render::SceneView scene;
  scene.topology_version = visited.replica->topology_version();
  scene.rest_positions = topology.rest_positions;
  scene.triangles = topology.triangles;
  scene.is_wound = topology.is_wound;
  scene.positions = visited.surface.positions();
  auto camera = camera_on(topology.rest_positions);
  const auto draw = [&] {
    for (int i = 0; i < kPicturesAtOnce; ++i) {
      camera.orbit(0.01f, 0);
      renderer.draw(scene, camera, {.size = (*context)->size()});
      (*context)->present();
    }
    (void)(*context)->read_image();  // waits for them
  };
  draw();  // shaders and buffers are made with the first pictures
  const auto begin = monotonic_ns();
  std::uint64_t pictures = 0, taken = 0;
  while (taken < static_cast<std::uint64_t>(seconds * 1e9)) {
    draw();
    pictures += kPicturesAtOnce;
    taken = monotonic_ns() - begin;
  }
  if (taken > 0)
    graphics.pictures_per_second =
        static_cast<double>(pictures) / (static_cast<double>(taken) * 1e-9);
  return graphics;
}

std::vector<Device> find_devices() {
  std::vector<Device> devices;
  for (const auto& listed : device::list_devices())
    devices.push_back({.name = listed.name,
                       .is_real = listed.name != "simulated" && listed.name != "journal",
                       .is_found = listed.is_found,
                       .text = listed.text});
  return devices;
}

std::optional<double> free_bytes_in(const std::string& folder) {
  std::error_code error;
  const auto space = std::filesystem::space(folder, error);
  if (error) return std::nullopt;
  return static_cast<double>(space.available);
}

}  // namespace trocar::doctor
