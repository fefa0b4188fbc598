#include "client/embedding/fine_shape.h"

namespace trocar::embedding {

FineShape shape_of(const wire::FineSurface& fine) {
  FineShape shape;
  for (std::size_t v = 0; v < fine.quanta.size(); ++v)
    shape.positions.push_back(fine.position_m(v));
  shape.triangles = fine.triangles;
  for (const auto& [u, v] : fine.texture)
    shape.texture.push_back({static_cast<float>(u * wire::kTextureQuantum),
                             1 - static_cast<float>(v * wire::kTextureQuantum)});
  return shape;
}

}  // namespace trocar::embedding
