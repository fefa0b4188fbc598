#pragma once

// An organ's surface as client/render draws it: held nodes and regions in colours. Needs no OpenGL.

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "client/device/view_rays.h"
#include "client/render/scene_renderer.h"
#include "common/wire/fine_surface.h"
#include "server/organs/edit/surface_brush.h"
#include "server/organs/organ/organ.h"

namespace trocar::editor {

// Held nodes have the colour of this participant's slot in a session.
inline constexpr std::uint8_t kHeldColour = 1;
// Regions have other slots' colours, and each another one than its neighbours in number.
constexpr std::uint8_t colour_of_part(std::size_t region) {
  constexpr std::array<std::uint8_t, 7> kSlots{0, 2, 3, 6, 5, 7, 8};
  return kSlots[region % kSlots.size()];
}

class OrganView {
 public:
  // The organ must outlive it, with its mesh as it is.
  explicit OrganView(const organ::Organ& organ);

  // Takes over what is held and where the regions are.
  void colour(const organ::Organ& organ);
  // Moves the surface: per node its displacement from rest, m; empty: it is at rest.
  void move(std::span<const Vec3f> displacements);
  // The place that is seen at a pixel; none: it is beside the organ.
  std::optional<edit::SurfacePlace> place_at(const device::ViewRays& view, float x, float y) const;
  // Outward normal of the place's triangle at rest, unit length.
  Vec3d normal_at(const edit::SurfacePlace& place) const;

  // The spans are of this object. shows_fine: the fine surface takes the mesh's place, if there is
  // one.
  render::SceneView scene(bool shows_held, bool shows_regions, bool shows_fine) const;
  // The colour of each surface node, in the order of mesh.surface_nodes.
  std::vector<render::Hold> colours(bool shows_held, bool shows_regions) const;
  float radius_m() const { return radius_m_; }  // half the diagonal of the rest bounding box

 private:
  const mesh::TetMesh& mesh_;
  std::shared_ptr<const wire::FineSurface> fine_;  // null: there is none
  std::vector<Vec3f> rest_, positions_;            // per surface node
  std::vector<std::array<std::uint32_t, 3>> triangles_;
  std::vector<std::uint16_t> parts_;   // per surface node: 0 the organ's own, r + 1 regions[r]
  std::vector<std::uint8_t> is_held_;  // likewise
  float radius_m_ = 0.1f;
};

}  // namespace trocar::editor
