#pragma once

// One point of a material that is led through a deformation: what homogeneous specimens do, without
// a mesh. Uniaxial and equibiaxial specimens find their free sides by Newton's method. One thread.

#include <optional>
#include <vector>

#include "server/lab/finite_elements/relaxation.h"

namespace trocar::finite_elements {

class MaterialPoint {
 public:
  explicit MaterialPoint(material::HyperelasticMaterial material)
      : material_(std::move(material)), history_(history_size(material_.relaxation.size())) {}

  // Second Piola-Kirchhoff stress and tangent at the end of a step of dt_s that ends at f; nothing
  // where f is not admissible. Does not move time on.
  struct Response {
    Vector6 stress;
    Matrix6 tangent;
  };
  std::optional<Response> respond(const Matrix3& f, double dt_s) const;
  // The step is done; f must be admissible.
  void advance(const Matrix3& f, double dt_s);

  const material::HyperelasticMaterial& material() const { return material_; }

 private:
  material::HyperelasticMaterial material_;
  std::vector<double> history_;
};

// A specimen between two plates without friction (uniaxial, also in compression), in a biaxial
// frame, or in simple shear, led by its stretch (shear: amount of shear).
class Specimen {
 public:
  Specimen(material::HyperelasticMaterial material, material::TestMode mode)
      : point_(std::move(material)), mode_(mode) {}

  // Nominal stress (force over area at rest) in Pa after a step of dt_s to `stretch`; nothing if no
  // equilibrium of the free sides was found.
  std::optional<double> stretch_to(double stretch, double dt_s);
  double free_stretch() const { return free_stretch_; }

 private:
  Matrix3 deformation(double stretch, double free_stretch) const;

  MaterialPoint point_;
  material::TestMode mode_;
  double free_stretch_ = 1;  // of the sides without load
};

}  // namespace trocar::finite_elements
