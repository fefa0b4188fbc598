#pragma once

// How much tissue was stretched beyond what it bears. A recording has the surface alone, so the
// session is simulated again, which takes about as long as the session did.

#include <functional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/lesson/lesson.h"
#include "server/session/assessment/assessment.h"
#include "server/tissue/step/simulation.h"

namespace trocar::assessment {

// Marks small cells of the organ at rest in which tissue was strained too far at any time. Cells
// are 2 mm wide, or wider where the organ has more than four million of them.
class StrainMap {
 public:
  // limit: greatest principal strain, the stretch minus one.
  StrainMap(const organ::Organ& organ, double limit);

  void look(const step::Simulation& simulation);

  double greatest() const { return greatest_; }  // strain so far
  Tick greatest_tick() const { return greatest_tick_; }
  double volume_m3() const;
  double volume_within_m3(const lesson::Structure& structure) const;

 private:
  void mark(const std::array<Vec3d, 4>& rest);
  Vec3d centre_of(std::size_t cell) const;

  double limit_, width_m_;
  Vec3d origin_;
  std::array<std::size_t, 3> size_{};
  std::vector<bool> cells_;
  std::vector<mesh::Tet> marked_;  // by place of the tet
  double greatest_ = 0;
  Tick greatest_tick_ = 0;
};

// Looks 16 times a second. `progress` is called now and then with the tick reached. Errors: the
// session cannot be simulated again by this program, or comes out otherwise.
Result<StrainDamage> measure_strain(const std::string& journal, double limit,
                                    const lesson::Lesson* lesson,
                                    const std::function<void(Tick, Tick last)>& progress = {});

}  // namespace trocar::assessment
