#pragma once

// The threads that there are: material, and size by the classes of the United States Pharmacopeia.
//
// Diameters: in the middle of their class, of collagen-free threads. Modulus of silk, and breaking
// loads of nylon and polypropylene (knotted): Naleway 2015, J Biomed Mater Res B 103:735, for 3-0;
// other sizes by area. Polyglactin breaks as the class asks for (USP <861>, 17.4 N at 3-0). All
// other figures are our choice: moduli of 1.8 to 3 GPa for solid strands and that of silk for the
// other braid; of a braid's bending stiffness 3 % is left, for its fibres slide on each other.
// Friction of thread on thread falls with tension and is higher for braids (Zhang 2017, Friction
// 5:87): one value each stands for it.

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

namespace trocar::thread {

enum class Material : std::uint8_t { Silk, Nylon, Polyglactin, Polypropylene };
enum class Size : std::uint8_t { Usp2_0, Usp3_0, Usp4_0 };
inline constexpr std::array<std::string_view, 4> kMaterialNames{"silk", "nylon", "polyglactin",
                                                                "polypropylene"};
inline constexpr std::array<std::string_view, 3> kSizeNames{"2-0", "3-0", "4-0"};

struct Suture {
  double diameter_m = 0;
  double stretch_n = 0;      // E A: tension at a strain of 1
  double bending_nm2 = 0;    // E I
  double density_kg_m = 0;   // per length
  double breaks_n = 0;       // at this tension
  double self_friction = 0;  // Coulomb's coefficient of thread on thread
  bool is_braid = false;
};

Suture suture_of(Material material, Size size);

}  // namespace trocar::thread
