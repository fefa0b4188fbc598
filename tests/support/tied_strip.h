#pragma once

// A strip of wall on a bed that stands, held by ties, and how it is peeled off from its free end at
// right angles: in a steady peel the work is the toughness of what comes off.

#include <cmath>
#include <optional>
#include <string>

#include "common/base/assert.h"
#include "server/organs/catalogue/join_parts.h"
#include "server/tissue/step/simulation.h"

namespace trocar::testing {

struct StripRule {
  double spacing_mm = 5, length_mm = 60, thickness_mm = 2, width_mm = 10;
  double toughness_j_m2 = 20, strength_pa = 8000, young_modulus_pa = 1e5, each_mm2 = 4;
};

inline organ::Organ make_strip(const StripRule& rule) {
  const auto n = [&](double mm) { return std::to_string(std::lround(mm / rule.spacing_mm)); };
  const auto s = [](double value) { return std::to_string(value); };
  const std::string text =
      "[[part]]\nname = 'bed'\nsource = 'box'\nsize_mm = [" + s(rule.length_mm - 10) + ", 4, " +
      s(rule.width_mm) + "]\ncells = [" + n(rule.length_mm - 10) + ", 1, " + n(rule.width_mm) +
      "]\nat_mm = [5, " + s(-4 - rule.thickness_mm / 2) +
      ", 0]\nhold = 'all'\n"
      "[[part]]\nname = 'strip'\nsource = 'box'\nsize_mm = [" +
      s(rule.length_mm) + ", " + s(rule.thickness_mm) + ", " + s(rule.width_mm) + "]\ncells = [" +
      n(rule.length_mm) + ", 1, " + n(rule.width_mm) +
      "]\nyoung_modulus_pa = " + s(rule.young_modulus_pa) +
      "\n[[ties]]\nbetween = ['strip', 'bed']\nwithin_mm = 2.5\neach_mm2 = " + s(rule.each_mm2) +
      "\nstrength_pa = " + s(rule.strength_pa) + "\ntoughness_j_m2 = " + s(rule.toughness_j_m2) +
      "\n";
  const auto file = catalogue::parse_parts_text(text, "strip.toml");
  TROCAR_ASSERT(file.ok());
  auto joined = catalogue::join_parts(*file);
  TROCAR_ASSERT(joined.ok());
  return std::move(joined->organ);
}

// The strip's end is held and goes up and along at this speed: the free part stands upright.
class Peel {
 public:
  explicit Peel(const StripRule& rule, double speed_m_s = 0.1, unsigned workers = 1,
                std::uint32_t sweeps = 4)
      : move_m_{speed_m_s * 1e-3, speed_m_s * 1e-3, 0} {
    auto organ = make_strip(rule);
    double first = 1;
    for (const auto& p : organ.mesh.rest_positions) first = std::min(first, p.x);
    step::SceneRules rules;
    step::DisplacedNodes end;
    for (std::size_t n = 0; n < organ.mesh.node_count(); ++n)
      if (organ.mesh.rest_positions[n].x < first + 1e-6) end.nodes.emplace_back(n);
    constexpr double kLongest_s = 100;
    end.over_time.keys = {{0, {}}, {kLongest_s, move_m_ * (kLongest_s * 1e3)}};
    rules.loads.displaced.push_back(end);
    simulation_.emplace(std::move(organ), workers, rules);
    watched_ = simulation_->loads().watch(end.nodes);
    decisions_.boundary = world::Boundary::Whole;
    decisions_.sweeps = sweeps;
  }

  const step::TickReport& tick() {
    const auto& report = simulation_->tick({}, decisions_);
    force_n_ = simulation_->loads().holding_force_n(watched_);
    work_j_ += dot(force_n_, move_m_);
    return report;
  }
  step::Simulation& simulation() { return *simulation_; }
  Vec3d force_n() const { return force_n_; }
  double work_j() const { return work_j_; }

  // Until the last tie has broken, J; NaN: it does not.
  double whole_work_j() {
    for (int i = 0; i < 20'000; ++i)
      if (tick().ties.whole == 0) return work_j_;
    return std::nan("");
  }
  double tied_area_m2() const {
    const auto& ties = simulation_->state().cuts.topology().ties();
    double area_m2 = 0;
    for (std::size_t i = 0; i < ties.count(); ++i) area_m2 += ties[i].area_m2;
    return area_m2;
  }

 private:
  Vec3d move_m_;
  std::optional<step::Simulation> simulation_;
  step::TickDecisions decisions_;
  std::size_t watched_ = 0;
  Vec3d force_n_;
  double work_j_ = 0;
};

// Work over area, J/m^2: what a strip takes more than one of half its length. So it is that of the
// steady peel; to begin and to end one takes some, too.
inline double peel_work(StripRule rule, std::uint32_t sweeps) {
  Peel longer(rule, 0.1, 1, sweeps);
  rule.length_mm /= 2;
  Peel shorter(rule, 0.1, 1, sweeps);
  return (longer.whole_work_j() - shorter.whole_work_j()) /
         (longer.tied_area_m2() - shorter.tied_area_m2());
}

}  // namespace trocar::testing
