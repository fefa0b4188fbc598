#pragma once

// The figures by which a session bleeds; docs/bleeding.md says where they come from and how far to
// trust them. SI units.

#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/math/vec3.h"

namespace trocar::bleeding {

inline constexpr double kFrameSeconds = 0.016;
inline constexpr double kPascalPerMmHg = 133.322;
inline constexpr double kBloodDensity = 1060;      // kg/m^3
inline constexpr double kBloodViscosity = 3.5e-3;  // Pa s, as it flows fast
inline constexpr double kGravity = 9.81;           // m/s^2, towards -y
inline constexpr double kOrificeCoefficient = 0.6;
// A film of this depth stays where blood has been.
inline constexpr double kStayingFilmM = 30e-6;
// A film that hangs falls off in drops once it is as deep as this.
inline constexpr double kHangingFilmM = 0.5e-3;

// A tube through the organ, at rest, in which blood stands under pressure.
struct Vessel {
  std::string name;
  Vec3d from_m, to_m;
  double radius_m = 0.002;
  double pressure_pa = 80 * kPascalPerMmHg;
  double most_flow_m3_s = 100e-6 / 60;  // as much comes after if it lies open wide

  double distance_m(const Vec3d& place_m) const;  // at rest, negative within
};

struct Rules {
  double ooze_m_s = 0.05e-2;  // of fresh parenchyma, volume by area and time: 0.05 ml/s per cm^2
  double clotting_time_s = 80;
  double ooze_pressure_pa = 10 * kPascalPerMmHg;  // pressed harder, parenchyma bleeds no more
  std::vector<Vessel> vessels;
};

// The most of each that a file may say, and the least above zero.
inline constexpr double kMostOoze = 0.1, kMostClottingSeconds = 1e5, kMostPressurePa = 1e5;
inline constexpr double kMostFlow = 1e-3;
inline constexpr std::size_t kMostVessels = 16;

// Errors name the field and the limit.
Status validate(const Rules& rules);

}  // namespace trocar::bleeding
