#include "server/tissue/thread/sutures.h"

#include <numbers>

namespace trocar::thread {
namespace {

struct Figures {
  double young_pa, density_kg_m3;
  double bending_share;  // of that of a solid strand
  double strength_pa;    // breaking load by area
  double self_friction;
};

constexpr double kBraidBends = 0.03;
constexpr std::array<double, 3> kDiametersM{0.32e-3, 0.23e-3, 0.18e-3};

constexpr std::array<Figures, 4> kFigures{{
    {8.7e9, 1100, kBraidBends, 0.43e9, 0.2},  // silk
    {1.8e9, 1140, 1, 0.74e9, 0.15},           // nylon
    {8.7e9, 1300, kBraidBends, 0.42e9, 0.2},  // polyglactin
    {2.7e9, 910, 1, 0.455e9, 0.15},           // polypropylene
}};

}  // namespace

Suture suture_of(Material material, Size size) {
  const auto& figures = kFigures[static_cast<std::size_t>(material)];
  const double d = kDiametersM[static_cast<std::size_t>(size)];
  const double area = std::numbers::pi / 4 * d * d;
  Suture suture;
  suture.diameter_m = d;
  suture.stretch_n = figures.young_pa * area;
  suture.bending_nm2 = figures.young_pa * figures.bending_share * area * d * d / 16;
  suture.density_kg_m = figures.density_kg_m3 * area;
  suture.breaks_n = figures.strength_pa * area;
  suture.self_friction = figures.self_friction;
  suture.is_braid = figures.bending_share < 1;
  return suture;
}

}  // namespace trocar::thread
