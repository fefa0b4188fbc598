#pragma once

// A table says what organs look like, and authors may add to it. The first row of which a word is
// in the organ's name says how it is drawn, in the window and on the page alike; a name with none
// of them gets the first row. Names are those of built-in organs, or what an imported organ is
// called, in small or capital letters.
//
// Colours are linear, as tissue answers a white lamp of the theatre. Numbers without a unit are
// shares of a liver's.

#include <array>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "client/shape/smooth_surface.h"
#include "common/math/vec3.h"

namespace trocar::shape {

struct TissueLook {
  std::string_view words;  // with spaces between them
  Vec3f dark, light;       // the outside: in the troughs and on the heights of its pattern
  Vec3f line;              // vessels or fibres on it
  float lines;             // how much of them, 0 to 1
  float pattern = 1;       // larger: finer
  float gloss = 1, relief = 1;
  Vec3f cut_dark, cut_light, septum;  // what a blade lays open, and what parts its lobules
  float septa = 0.2f;                 // how much of that, 0 to 1
  float lobules = 1;                  // 0: even all through
  float translucency = 1;             // light comes through where it is thin
  // Parts that nothing holds, one after the other, where they differ; black: they do not.
  std::array<Vec3f, 3> loose{};
};

// clang-format off
inline constexpr std::array<TissueLook, 16> kTissueLooks{{
    {.words = "liver hepa leber foie",
     .dark = {0.068f, 0.0115f, 0.0090f}, .light = {0.138f, 0.0245f, 0.0165f},
     .line = {0.100f, 0.020f, 0.015f}, .lines = 0.0f,
     .cut_dark = {0.034f, 0.0036f, 0.0030f}, .cut_light = {0.098f, 0.0150f, 0.0105f},
     .septum = {0.088f, 0.021f, 0.015f}, .septa = 0.30f},
    {.words = "gallbladder gall chole vesica",
     .dark = {0.060f, 0.070f, 0.026f}, .light = {0.140f, 0.130f, 0.046f},
     .line = {0.120f, 0.020f, 0.015f}, .lines = 0.45f, .pattern = 1.3f, .gloss = 1.25f, .relief = 0.7f,
     .cut_dark = {0.190f, 0.085f, 0.035f}, .cut_light = {0.300f, 0.160f, 0.070f},
     .septum = {0.220f, 0.150f, 0.080f}, .lobules = 0.3f},
    {.words = "stomach gastr magen serosa antrum fundus",
     .dark = {0.275f, 0.100f, 0.072f}, .light = {0.420f, 0.185f, 0.135f},
     .line = {0.205f, 0.028f, 0.024f}, .lines = 0.55f, .pattern = 1.25f, .gloss = 1.05f, .relief = 0.65f,
     .cut_dark = {0.240f, 0.072f, 0.054f}, .cut_light = {0.400f, 0.150f, 0.110f},
     .septum = {0.480f, 0.270f, 0.190f}, .septa = 0.3f, .lobules = 0.45f},
    {.words = "bowel colon intestin ileum jejun duoden rectum oesoph esoph darm",
     .dark = {0.330f, 0.120f, 0.090f}, .light = {0.470f, 0.220f, 0.165f},
     .line = {0.210f, 0.032f, 0.030f}, .lines = 0.65f, .pattern = 1.7f, .gloss = 1.1f, .relief = 0.6f,
     .cut_dark = {0.260f, 0.080f, 0.060f}, .cut_light = {0.420f, 0.170f, 0.120f},
     .septum = {0.480f, 0.270f, 0.190f}, .lobules = 0.4f},
    {.words = "kidney renal nephr niere",
     .dark = {0.105f, 0.0270f, 0.0190f}, .light = {0.175f, 0.0520f, 0.0350f},
     .line = {0.080f, 0.012f, 0.010f}, .lines = 0.20f, .pattern = 1.5f, .gloss = 1.2f, .relief = 0.55f,
     .cut_dark = {0.150f, 0.036f, 0.027f}, .cut_light = {0.270f, 0.090f, 0.062f},
     .septum = {0.330f, 0.150f, 0.100f}, .septa = 0.3f, .lobules = 0.7f},
    {.words = "spleen splen lien milz",
     .dark = {0.052f, 0.0100f, 0.0165f}, .light = {0.105f, 0.0200f, 0.0300f},
     .line = {0.060f, 0.010f, 0.015f}, .lines = 0.0f, .pattern = 1.4f, .relief = 0.9f,
     .cut_dark = {0.060f, 0.0050f, 0.0075f}, .cut_light = {0.130f, 0.0150f, 0.0170f},
     .septum = {0.170f, 0.070f, 0.060f}, .septa = 0.25f, .lobules = 0.8f},
    {.words = "heart cardi myocard herz muscle",
     .dark = {0.125f, 0.0230f, 0.0180f}, .light = {0.215f, 0.0500f, 0.0370f},
     .line = {0.480f, 0.280f, 0.095f}, .lines = 0.30f, .pattern = 0.9f, .gloss = 1.1f, .relief = 0.8f,
     .cut_dark = {0.120f, 0.0180f, 0.0150f}, .cut_light = {0.230f, 0.0450f, 0.0340f},
     .septum = {0.280f, 0.090f, 0.070f}, .lobules = 0.5f},
    {.words = "lung pulmo lunge",
     .dark = {0.300f, 0.130f, 0.125f}, .light = {0.450f, 0.240f, 0.220f},
     .line = {0.110f, 0.060f, 0.065f}, .lines = 0.40f, .pattern = 2.2f, .gloss = 0.8f, .relief = 0.8f,
     .cut_dark = {0.230f, 0.060f, 0.055f}, .cut_light = {0.380f, 0.130f, 0.115f},
     .septum = {0.420f, 0.240f, 0.210f}, .septa = 0.3f},
    {.words = "brain cortex cerebr gehirn",
     .dark = {0.330f, 0.190f, 0.155f}, .light = {0.480f, 0.320f, 0.265f},
     .line = {0.190f, 0.030f, 0.030f}, .lines = 0.60f, .pattern = 2.0f, .gloss = 1.1f, .relief = 0.8f,
     .cut_dark = {0.420f, 0.300f, 0.230f}, .cut_light = {0.560f, 0.450f, 0.360f},
     .septum = {0.500f, 0.360f, 0.280f}, .lobules = 0.2f},
    {.words = "fat omentum mesent adip fett pancrea",
     .dark = {0.400f, 0.215f, 0.050f}, .light = {0.640f, 0.420f, 0.125f},
     .line = {0.260f, 0.040f, 0.026f}, .lines = 0.25f, .pattern = 2.4f, .relief = 1.7f,
     .cut_dark = {0.420f, 0.240f, 0.060f}, .cut_light = {0.650f, 0.430f, 0.140f},
     .septum = {0.480f, 0.330f, 0.170f}, .septa = 0.4f},
    {.words = "bone rib skull femur vertebra spine pelvis knochen",
     .dark = {0.430f, 0.350f, 0.235f}, .light = {0.620f, 0.545f, 0.420f},
     .line = {0.330f, 0.180f, 0.120f}, .lines = 0.15f, .pattern = 1.6f, .gloss = 0.35f, .relief = 0.8f,
     .cut_dark = {0.320f, 0.130f, 0.080f}, .cut_light = {0.540f, 0.330f, 0.220f},
     .septum = {0.600f, 0.480f, 0.350f}, .septa = 0.5f},
    {.words = "vessel aorta arter vein vena vascul",
     .dark = {0.270f, 0.062f, 0.055f}, .light = {0.400f, 0.130f, 0.105f},
     .line = {0.420f, 0.230f, 0.170f}, .lines = 0.25f, .pattern = 2.0f, .gloss = 1.15f, .relief = 0.5f,
     .cut_dark = {0.260f, 0.080f, 0.065f}, .cut_light = {0.420f, 0.200f, 0.160f},
     .septum = {0.480f, 0.300f, 0.240f}, .lobules = 0.2f},
    {.words = "chest thorax skin breast wall",
     .dark = {0.340f, 0.165f, 0.110f}, .light = {0.480f, 0.270f, 0.190f},
     .line = {0.300f, 0.090f, 0.070f}, .lines = 0.15f, .pattern = 1.2f, .gloss = 0.45f, .relief = 0.8f,
     .cut_dark = {0.330f, 0.090f, 0.055f}, .cut_light = {0.560f, 0.340f, 0.130f},
     .septum = {0.500f, 0.320f, 0.180f}, .septa = 0.35f},
    {.words = "pegs board trainer",
     .dark = {0.105f, 0.122f, 0.132f}, .light = {0.115f, 0.132f, 0.142f},
     .line = {0.285f, 0.325f, 0.345f}, .lines = 0.0f, .gloss = 0.55f, .relief = 0.03f,
     .cut_dark = {0.290f, 0.330f, 0.350f}, .cut_light = {0.320f, 0.360f, 0.380f},
     .septum = {0.300f, 0.340f, 0.360f}, .septa = 0.0f, .lobules = 0.0f, .translucency = 0.05f,
     .loose = {{{0.300f, 0.046f, 0.008f}, {0.018f, 0.075f, 0.250f}, {0.300f, 0.200f, 0.010f}}}},
    {.words = "ring rubber plastic",
     .dark = {0.520f, 0.085f, 0.012f}, .light = {0.550f, 0.095f, 0.014f},
     .line = {0.520f, 0.085f, 0.012f}, .lines = 0.0f, .gloss = 0.5f, .relief = 0.03f,
     .cut_dark = {0.480f, 0.078f, 0.011f}, .cut_light = {0.530f, 0.090f, 0.013f},
     .septum = {0.500f, 0.080f, 0.012f}, .septa = 0.0f, .lobules = 0.0f, .translucency = 0.1f},
    {.words = "plate lattice block gel phantom silicone",
     .dark = {0.330f, 0.205f, 0.125f}, .light = {0.395f, 0.255f, 0.165f},
     .line = {0.330f, 0.205f, 0.125f}, .lines = 0.0f, .gloss = 0.7f, .relief = 0.35f,
     .cut_dark = {0.340f, 0.215f, 0.135f}, .cut_light = {0.430f, 0.290f, 0.190f},
     .septum = {0.380f, 0.250f, 0.160f}, .septa = 0.1f, .lobules = 0.3f},
}};
// clang-format on

const TissueLook& look_of(std::string_view organ_name);

// The shader knows so many parts of an organ apart; the last one stands for all beyond.
inline constexpr std::size_t kLookParts = 4;
// The shader takes these, in this order.
struct LookFigures {
  std::array<Vec3f, kLookParts> dark, light;
  std::array<float, 4> lines, figures;
};
LookFigures outside_figures(const TissueLook& look);
LookFigures inside_figures(const TissueLook& look);

// Returns the part that each coarse vertex belongs to, 0 to 3. What is held is part 0, and so is
// all of an organ whose loose parts look the same; those that nothing holds are numbered from 1 in
// the order of their first vertices. Cost: linear.
std::vector<std::uint8_t> parts_of(const TissueLook& look, std::size_t vertices,
                                   std::span<const TriangleCorners> triangles,
                                   std::span<const std::uint32_t> held);

}  // namespace trocar::shape
