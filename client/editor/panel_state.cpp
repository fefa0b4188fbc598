#include "client/editor/panel_state.h"

#include <cstdio>

#include "server/organs/organ/organ_figures.h"

namespace trocar::editor {
namespace {

template <typename... Numbers>
std::string text_of(const char* format, Numbers... numbers) {
  char text[160];
  std::snprintf(text, sizeof text, format, numbers...);
  return text;
}

std::string words_of(const material::Material& m) {
  switch (m.elastic_law) {
    case material::ElasticLaw::Measured:
      return m.measured.name;
    case material::ElasticLaw::NeoHookean:
      return text_of("neo-Hookean, %.3g kPa", m.young_modulus_pa / 1e3);
    case material::ElasticLaw::TensorMass:
      return text_of("linear, %.3g kPa", m.young_modulus_pa / 1e3);
    case material::ElasticLaw::Springs:
      break;
  }
  return m.spring_law == material::SpringLaw::Constant
             ? text_of("springs, %.3g N/m", m.spring_stiffness_n_m)
             : text_of("springs, %.3g kPa", m.young_modulus_pa / 1e3);
}

}  // namespace

PanelFigures figures_of(const edit::Editor& editor) {
  const auto& organ = editor.organ();
  const auto& mesh = organ.mesh;
  const Vec3d size_mm = organ::size_of(mesh) * 1e3;
  PanelFigures figures{.name = organ.name, .source = organ.source};
  figures.rows = {
      {"nodes", text_of("%zu, %zu on the surface", mesh.node_count(), mesh.surface_nodes.size())},
      mesh.tets.empty() ? std::pair{std::string("springs"), text_of("%zu", mesh.links.size())}
                        : std::pair{std::string("tets"), text_of("%zu", mesh.tets.size())},
      {"size", text_of("%.1f x %.1f x %.1f mm", size_mm.x, size_mm.y, size_mm.z)},
      {"volume", text_of("%.4g ml", organ::enclosed_volume(mesh) * 1e6)},
      {"mass", text_of("%.4g g", organ::mass_kg(organ) * 1e3)},
      {"held", text_of("%zu nodes, %.1f %%", organ.fixed_nodes.size(),
                       100.0 * static_cast<double>(organ.fixed_nodes.size()) /
                           static_cast<double>(mesh.node_count()))}};
  figures.part_materials.push_back(words_of(organ.material));
  for (const auto& region : organ.regions)
    figures.part_materials.push_back(words_of(region.material));
  figures.part_elements = editor.element_counts();
  figures.element = mesh.tets.empty() ? "springs" : "tets";
  figures.remarks = editor.remarks();
  return figures;
}

}  // namespace trocar::editor
