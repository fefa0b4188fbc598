#include "server/tissue/bleeding/rules.h"

#include "common/math/tube.h"

namespace trocar::bleeding {
namespace {

bool is_within(double value, double least, double most) {
  return value >= least && value <= most;  // false for what is not a number
}

Error wrong(const std::string& field, const char* range) {
  return {ErrorCode::BadFile, field + ": is outside " + range};
}

}  // namespace

double Vessel::distance_m(const Vec3d& place_m) const {
  return distance_from_tube(place_m, from_m, to_m, radius_m);
}

Status validate(const Rules& rules) {
  if (!is_within(rules.ooze_m_s, 0, kMostOoze)) return wrong("ooze_m_s", "0 to 0.1 m/s");
  if (!is_within(rules.clotting_time_s, 1, kMostClottingSeconds))
    return wrong("clotting_time_s", "1 to 100000 s");
  if (!is_within(rules.ooze_pressure_pa, 0, kMostPressurePa))
    return wrong("ooze_pressure_pa", "0 to 100000 Pa");
  if (rules.vessels.size() > kMostVessels) return wrong("vessel", "0 to 16 of them");
  for (const auto& vessel : rules.vessels) {
    const bool is_near = is_finite(vessel.from_m) && is_finite(vessel.to_m) &&
                         length(vessel.from_m) <= 2 && length(vessel.to_m) <= 2;
    if (!is_near) return wrong("vessel.from_m, to_m", "2 m around the origin");
    if (!is_within(vessel.radius_m, 1e-4, 0.1)) return wrong("vessel.radius_m", "0.1 to 100 mm");
    if (!is_within(vessel.pressure_pa, 1, kMostPressurePa))
      return wrong("vessel.pressure_pa", "1 to 100000 Pa");
    if (!is_within(vessel.most_flow_m3_s, 1e-9, kMostFlow))
      return wrong("vessel.most_flow_m3_s", "1e-9 to 1e-3 m^3/s");
  }
  return {};
}

}  // namespace trocar::bleeding
