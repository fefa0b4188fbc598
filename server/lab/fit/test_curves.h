#pragma once

// Force curves of homogeneous specimens, loading and relaxation, from a CSV file: columns time_s,
// displacement_mm and force_n; optionally `test` (else the one that is asked for) and `curve`, a
// name that begins a new specimen where it changes. Times increase within a curve. Positive
// displacement and force are along the test's own direction:
//
//   tension      the specimen gets longer, and pulls
//   compression  it gets shorter between plates without friction, and presses
//   equibiaxial  a sheet gets longer both ways; also the apex of tissue in an aspiration tube, with
//                the membrane force there
//   shear        one face moves along the other
//
// Between rows the displacement is linear in time. If the first row is not at rest, it was reached
// at once. Error: the file, the line, what is wrong; numbers that no tissue gives are taken for a
// mistaken unit.

#include <filesystem>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "server/organs/material/hyperelastic_material.h"

namespace trocar::fit {

struct TestCurve {
  std::string name, test;
  material::TestMode mode = material::TestMode::Uniaxial;
  double length_m = 0, area_m2 = 0;  // of the specimen at rest
  // Per row; stretch (shear: its amount) and nominal stress as the specimen has them: a compressed
  // one has a stretch below 1 and a negative stress.
  std::vector<double> times_s, stretches, stresses_pa;

  double largest_stress_pa() const;
};

struct SpecimenSize {
  std::string test = "tension";
  double length_m = 0, area_m2 = 0;
};

Result<std::vector<TestCurve>> read_test_curves(const std::filesystem::path& path,
                                                const SpecimenSize& size);
// `source` stands for the file's name in messages.
Result<std::vector<TestCurve>> parse_test_curves(std::string_view text, const std::string& source,
                                                 const SpecimenSize& size);

}  // namespace trocar::fit
