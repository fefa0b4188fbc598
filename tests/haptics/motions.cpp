#include "tests/haptics/motions.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>

namespace trocar::haptics::testing {
namespace {

double ramp(double t, double begin, double end, double from, double to) {
  return from + (to - from) * std::clamp((t - begin) / (end - begin), 0.0, 1.0);
}
double smooth(double t, double begin, double end, double from, double to) {
  const double q = std::clamp((t - begin) / (end - begin), 0.0, 1.0);
  return from + (to - from) * q * q * q * (10 - 15 * q + 6 * q * q);
}
double wave(double t, double begin, double frequency_hz) {
  return t > begin ? std::sin(2 * std::numbers::pi * frequency_hz * (t - begin)) : 0;
}
double depth_share(double stiffness_n_m) {
  return std::clamp(139 / stiffness_n_m, 0.35, 1.0);
}

}  // namespace

Motion press(double stiffness_n_m) {
  const double share = depth_share(stiffness_n_m);
  return {.name = "press",
          .seconds = 4,
          .wanted_m =
              [=](double t) {
                return Vec3d{0, 0, smooth(t, 0.4, 1, 0.006, -0.009 * share)};
              },
          .steady_from_s = 3};
}

Motion palpation(double stiffness_n_m, double frequency_hz) {
  const double share = depth_share(stiffness_n_m);
  std::ostringstream name;
  name << frequency_hz << " Hz";
  return {.name = name.str(),
          .seconds = frequency_hz < 1 ? 7.5 : 5.5,
          .wanted_m =
              [=](double t) {
                return Vec3d{0, 0,
                             smooth(t, 0.3, 1, 0.006, -0.008 * share) +
                                 0.003 * share * wave(t, 1, frequency_hz)};
              },
          .frequency_hz = frequency_hz};
}

Motion taps(double stiffness_n_m) {
  const double low = -0.006 * depth_share(stiffness_n_m);
  return {.name = "taps", .seconds = 4, .wanted_m = [=](double t) {
            const double c = std::fmod(t, 0.7);
            return Vec3d{
                0, 0, c < 0.38 ? ramp(c, 0.3, 0.33, 0.006, low) : ramp(c, 0.38, 0.42, low, 0.006)};
          }};
}

Motion slide(double stiffness_n_m) {
  const double share = depth_share(stiffness_n_m);
  Motion motion{
      .name = "slide", .seconds = 5, .wanted_m = [=](double t) {
        const double way = t < 3 ? ramp(t, 1, 2.3, 0, 0.039) : ramp(t, 3, 4.3, 0.039, 0);
        const double turn = 2 * std::numbers::pi * std::max(0.0, t - 3);
        return Vec3d{way, 0.004 * std::sin(turn), smooth(t, 0.3, 0.8, 0.006, -0.007 * share)};
      }};
  motion.bump_m = 0.0007;
  return motion;
}

Motion grasp(double stiffness_n_m) {
  const double share = depth_share(stiffness_n_m);
  return {.name = "grasp",
          .seconds = 5.5,
          .wanted_m =
              [=](double t) {
                const double z = t > 1.2 ? smooth(t, 1.2, 1.8, -0.002, 0.010 * share)
                                         : smooth(t, 0.3, 0.7, 0.006, -0.002);
                const double turn = t < 4.5 ? 0.002 * share * wave(t, 2.5, 1) : 0;
                return Vec3d{smooth(t, 3.5, 4, 0, 0.005 * share),
                             smooth(t, 3, 3.4, 0, -0.003 * share), z + turn};
              },
          .grasp_s = 1,
          .release_s = 4.7};
}

Motion release(double stiffness_n_m) {
  const double low = -0.009 * depth_share(stiffness_n_m);
  return {
      .name = "release", .seconds = 3, .wanted_m = [=](double t) {
        return Vec3d{0, 0, t < 2 ? smooth(t, 0.3, 0.8, 0.006, low) : ramp(t, 2, 2.05, low, 0.008)};
      }};
}

Motion topology(double stiffness_n_m) {
  const double share = depth_share(stiffness_n_m);
  return {.name = "topology",
          .seconds = 5,
          .wanted_m =
              [=](double t) {
                return Vec3d{
                    0, 0,
                    smooth(t, 0.3, 0.9, 0.006, -0.008 * share) + 0.002 * share * wave(t, 1, 1)};
              },
          .happens =
              [](double t, SurrogateTissue& tissue) {
                if (t > 2) tissue.scale = t < 3.5 ? 0.5 : 0.9;
              }};
}

Motion refusal(double stiffness_n_m) {
  const double share = depth_share(stiffness_n_m);
  return {.name = "refusal",
          .seconds = 4,
          .wanted_m =
              [=](double t) {
                return Vec3d{0, 0,
                             t < 1.5 ? smooth(t, 0.3, 0.9, 0.006, -0.005 * share)
                                     : smooth(t, 1.6, 2.2, -0.005 * share, -0.010 * share)};
              },
          .happens =
              [](double t, SurrogateTissue& tissue) {
                if (t > 1.5) tissue.is_refused = true;
              },
          .steady_from_s = 3.2};
}

Motion lifted(double stiffness_n_m) {
  const double share = depth_share(stiffness_n_m);
  return {
      .name = "lifted",
      .seconds = 5,
      .wanted_m =
          [=](double t) {
            return Vec3d{0, 0, smooth(t, 0.4, 1, 0.006, -0.009 * share)};
          },
      .happens = [=](double t,
                     SurrogateTissue& tissue) { tissue.lift_m = 0.002 * share * wave(t, 1.5, 1); }};
}

Motion cut() {
  return {.name = "cut",
          .seconds = 3.5,
          .wanted_m =
              [](double t) {
                return Vec3d{0, 0, ramp(t, 0.3, 2.5, 0.006, -0.025)};
              },
          .cut_n = 0.7};
}

std::vector<Trial> trials() {
  std::vector<Trial> all(3);
  all[0] = {{.exponent = 1.5, .stiffness_n_m = 139, .fast_share = {1.9, 0.5}}, 1.3};
  all[1] = {{.exponent = 1.2, .stiffness_n_m = 100, .fast_share = {3.8, 0.95}}, 0.75};
  all[2] = {{.exponent = 1.4, .stiffness_n_m = 400, .fast_share = {0.6, 0.3}}, 1.3};
  return all;
}

tool::ToolShape probe() {
  return {.radius_m = 0.006f, .length_m = 0.2f, .reach_m = 0.008f};
}

wire::HapticLaw client_law(const TissueFigures& tissue, double guess) {
  wire::HapticLaw law;
  law.number = 1;
  law.exponent = 1.3f;
  law.poisson_ratio = 0.49f;
  law.relaxation[0] = {0.5054f, 0.5784f};
  law.relaxation[1] = {0.1485f, 6.8863f};
  law.fast[0] = {1.2f, 0.002f};
  law.fast[1] = {0.4f, 0.010f};
  law.youngs_modulus_pa = 1;
  const double per_pascal = first_guess(law, probe().radius_m).stiffness_n_m(0.003);
  const double wanted = guess * SurrogateTissue(tissue).elastic_stiffness_n_m(0.003);
  law.youngs_modulus_pa = static_cast<float>(wanted / per_pascal);
  return law;
}

}  // namespace trocar::haptics::testing
