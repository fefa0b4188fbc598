#pragma once

// The edge of a blade that cuts, as a hand feels it.
//
// Cutting. The edge is taken in parts. A part that meets whole tissue is held back by g_i, the
// energy per area of wound times its length in tissue (cutting/edge_resistance.h), so that its work
// is the energy of the area that it sweeps. But wounds open in rows of elements, not as the edge
// goes, and none opens where there is one already. So the force is p g_i, where p follows what has
// opened: with O the energy of the wound (Material::cut_energy_j_m2) that the hand has not worked
// for yet, counted in elements of way, e = O / (h sum of g_i),
//
//     h_s dp/dx = w c(e) - p,   c(e) = 1 + k (e - e_0), or less where long nothing has opened,
//
// over the mean way x of the parts across the edge; h is the length of an element. w is 1 where the
// tissue is whole as far as is known, and 0 where the blade comes into a wound or turns back, until
// one opens. So the work of a stroke is the energy of its wound, to a part of an element's way, and
// what has opened changes no force at once. The force on a part lies against its heading u_i, which
// follows the direction d of its own way across the edge,
//
//     h_u du_i/dx = d - u_i,
//
// so that it builds up, and turns, over h_u of way. A blade that stands loses it in a few tenths of
// a second: who stands feels no cutting.
//
// Ways are in the tissue: where it moves, so much less, or more, of the edge's own (tissue_m).
//
// Friction. Tissue that lies against the sides holds each part by a spring from where it was, which
// gives way where it would pull harder than the shear stress on the sides. So it is smooth at rest,
// and never gives back more than was put into it: with s the spring's length and d the way of a
// tick, the work k s'.d of the hand is at least k/2 (s'^2 - s^2), since s' is s + d or less of
// that.

#include <algorithm>
#include <array>
#include <cstdint>

#include "common/math/vec3.h"
#include "server/tissue/cutting/edge_resistance.h"
#include "server/tissue/world/state_archive.h"

namespace trocar::blades {

// The tissue acts on a blade with this force and torque, in the world frame.
struct Wrench {
  Vec3f force_n, torque_nm;  // about the tip
};

// Tip and the edge's other end, m, world frame.
using EdgeEnds = std::array<Vec3f, 2>;

class EdgeForce {
 public:
  // Ticks between two looks at what an edge meets. It is felt in equal steps until the next, so
  // that out of tissue all is over after two of these.
  static constexpr std::uint8_t kLookEvery = 4;

  EdgeForce() = default;
  explicit EdgeForce(const EdgeEnds& ends) : ends_(ends) {}

  const EdgeEnds& ends() const { return ends_; }
  // Returns the direction of the tip's motion, or zero.
  Vec3f direction() const { return normalized(velocity_, {}); }

  // The edge has been looked at. breadth_m: of both sides together.
  void look(const cutting::EdgeResistance& resistance, double breadth_m);
  void look_away() { look({}, 0); }

  // The edge has moved within a tick in which it opened a wound of so much energy. h_m: the length
  // of elements there.
  Wrench move(const EdgeEnds& ends, float opened_j, float h_m);
  // It does nothing, and what it owes is forgotten.
  void rest(const EdgeEnds& ends);
  // Returns how far the tissue at either end of the edge moves in a tick, m.
  const EdgeEnds& tissue_m() const { return tissue_m_; }
  // Returns with how much force a blade that goes on is held back by what it cuts here, N.
  float cutting_n() const;
  // Returns how fast it goes through whole tissue, m/s: p times the mean speed across the edge of
  // the parts that meet some. So it is the same in tough tissue and in soft, and 0 in a wound.
  float cutting_speed_m_s() const { return std::min(1.0f, share_) * speed_m_s_; }
  bool meets_tissue() const { return cutting_n() > 0 || most_friction_n() > 0; }
  // Returns with how much friction holds it at most, N.
  float most_friction_n() const;

  void visit_state(world::StateArchive& archive);

 private:
  struct Part {
    float cut_n = 0, next_cut_n = 0;    // g_i, and as it was last seen
    float grip_n = 0, next_grip_n = 0;  // what friction bears at most; likewise
    Vec3f heading;                      // u_i, no longer than 1
    Vec3f held;                         // m, of friction's spring: from where it pulls nothing
  };
  // Sums over the parts, in a tick.
  struct Sums {
    float cut_n = 0, paid_j = 0, swept_j = 0;
  };

  void follow_look();
  void follow_work(const Sums& sums, float opened_j, float moved_m, float h_m);

  EdgeEnds ends_{};
  Vec3f velocity_;       // m/s, of the tip, smoothed
  float speed_m_s_ = 0;  // across the edge, of the parts that meet tissue
  std::array<Part, cutting::kEdgeParts> parts_{};
  EdgeEnds tissue_m_{};          // in a tick, as it was last seen
  std::uint8_t steps_left_ = 0;  // until the parts are as they were last seen
  float owed_j_ = 0;             // O
  float whole_ = 1;              // w
  float share_ = 1;              // p
};

}  // namespace trocar::blades
