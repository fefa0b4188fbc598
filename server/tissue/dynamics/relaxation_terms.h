#pragma once

// RelaxationTerms compute what a relaxing material does to a stress, for eight places (tets, or
// smoothing domains) at a time: the instantaneous stress, and how the parts q_k that have relaxed
// follow over one or more steps (relaxation.h). Immutable but for set_dt(): any thread.

#include <array>
#include <vector>

#include "server/organs/organ/organ.h"
#include "server/tissue/dynamics/lanes.h"
#include "server/tissue/world/stress_history.h"

namespace trocar::dynamics {

bool relaxes(const material::Material& material);

// Materials of eight places, as organ::material_at() counts.
struct LaneMaterials {
  std::array<std::uint16_t, kLanes> of_lane{};
  bool is_uniform = true;

  void set(std::size_t lane, std::uint16_t material);
};

class RelaxationTerms {
 public:
  // Longest time that a place can wait, in steps: its turn, and once more where a part of a tet
  // that was cut came to be among others.
  static constexpr std::size_t kMostSteps = 16;
  // Steps that forces of what has relaxed are for: those until the place's next turn, or those of
  // nodes whose own turn to take them comes at any time until then, and which keep them as long.
  enum class Use { UntilTurn, InTurns };
  using Steps = world::StressHistory::Steps;

  struct Term {
    Lanes decay, of_before, of_now;  // e, g (1 - e - b), g b; over the steps since the last
    Lanes next_decay, ahead;         // e, g (1 - e); over the steps ahead
  };
  struct Constants {
    Lanes two_c10, bulk;          // Pa
    std::array<Lanes, 4> slopes;  // 2 C20 / C10, 3 C30 / C10, ...
    Lanes exponent;               // of an exponential law, else 0
    bool is_exponential = false;  // in some lane
    std::vector<Term> terms;
  };

  // The organ must outlive it.
  RelaxationTerms(const organ::Organ& organ, Use use);

  float dt() const { return dt_; }
  // Steps of dt, s; `turns` of them from one turn to the next.
  void set_dt(float dt, std::uint32_t turns);

  // After set_dt(). span: steps over which the place is, or was, advanced.
  const Constants& of(const LaneMaterials& materials, const Steps& span, Constants& scratch) const;

  // At once, for the deformation gradient with columns f.
  struct Response {
    SymMat8 stress;        // of the bracket, Pa
    Float8 bracket, bulk;  // energy densities of it and of the volumetric term, Pa
    Float8 volume_ratio;
  };
  static Response response_of(const Constants& c, const Vec8& f0, const Vec8& f1, const Vec8& f2);

  // Returns what will have relaxed, Pa, on average over the steps that forces are for, from a
  // block of a history. A place that was advanced over so many steps will be over as many.
  SymMat8 ahead(std::span<const float> block, const Constants& c) const;
  // Advances the block to where the stress is `now`; returns its ahead().
  SymMat8 advance(std::span<float> block, const SymMat8& now, const Constants& c) const;
  // Sets the block to that of tissue which has long had this stress.
  void settle(std::span<float> block, const SymMat8& stress, const LaneMaterials& materials) const;

 private:
  Constants constants_of(const material::Material& material, std::size_t steps) const;

  double steps_ahead(std::size_t steps) const;

  const organ::Organ& organ_;
  const Use use_;
  const std::size_t terms_;
  float dt_ = 0;
  std::uint32_t turns_ = 1;
  std::vector<Constants> constants_;  // [steps - 1][material]
};

// Sums over lanes.
float sum_of_lanes(const Float8& values);
// a : b
Float8 product8(const SymMat8& a, const SymMat8& b);

}  // namespace trocar::dynamics
