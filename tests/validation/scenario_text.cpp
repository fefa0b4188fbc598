#include "tests/validation/scenario_text.h"

#include <spdlog/fmt/fmt.h>

namespace trocar::validation {
namespace {

std::string vector(const Vec3d& v) {
  return fmt::format("[{:.9g}, {:.9g}, {:.9g}]", v.x, v.y, v.z);
}

std::string load(const char* table, const char* value, const std::string& set,
                 const std::vector<TimedValue>& keys) {
  std::string text = fmt::format("[[{}]]\nset = \"{}\"\n", table, set);
  for (const auto& [time, v] : keys)
    text += fmt::format("[[{}.key]]\ntime_s = {:.9g}\n{} = {}\n", table, time, value, vector(v));
  return text + "\n";
}

}  // namespace

std::string lattice_organ(int nx, int ny, int nz, double spacing_mm) {
  return fmt::format("[organ]\nsource = \"lattice\"\nnodes = [{}, {}, {}]\nspacing_mm = {:.9g}\n\n",
                     nx, ny, nz, spacing_mm);
}

std::string organ_source(const std::string& source) {
  return fmt::format("[organ]\nsource = \"{}\"\n\n", source);
}

std::string box_set(const std::string& name, const Vec3d& low_mm, const Vec3d& high_mm) {
  return fmt::format("[[nodes]]\nname = \"{}\"\nbox_min_mm = {}\nbox_max_mm = {}\n\n", name,
                     vector(low_mm), vector(high_mm));
}

std::string near_set(const std::string& name, const Vec3d& point_mm, double radius_mm,
                     bool is_on_surface) {
  std::string text =
      fmt::format("[[nodes]]\nname = \"{}\"\nnearest_mm = {}\n", name, vector(point_mm));
  if (radius_mm > 0) text += fmt::format("radius_mm = {:.9g}\n", radius_mm);
  if (is_on_surface) text += "surface = true\n";
  return text + "\n";
}

std::string displace(const std::string& set, const std::vector<TimedValue>& keys_mm) {
  return load("displace", "displacement_mm", set, keys_mm);
}

std::string force(const std::string& set, const std::vector<TimedValue>& keys_n) {
  return load("force", "force_n", set, keys_n);
}

std::string tool(double radius_mm, double reach_mm, const Vec3d& shaft,
                 const std::vector<ToolKey>& keys) {
  std::string text = fmt::format(
      "[[tool]]\nradius_mm = {:.9g}\nreach_mm = {:.9g}\nease = \"linear\"\n", radius_mm, reach_mm);
  for (const auto& key : keys)
    text +=
        fmt::format("[[tool.key]]\ntime_s = {:.9g}\nposition_mm = {}\nshaft = {}\nverb = \"{}\"\n",
                    key.time_s, vector(key.position_mm), vector(shaft), key.verb);
  return text + "\n";
}

}  // namespace trocar::validation
