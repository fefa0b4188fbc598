#include "server/organs/catalogue/stomach_shape.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "server/organs/catalogue/smooth_min.h"

namespace trocar::catalogue {
namespace {

// A place on a centre line and the radius of the outer face around it.
struct Station {
  Vec3d p;
  double r;
};

// From the top of the fundus to behind the pylorus.
constexpr std::array kSacStations = {
    Station{{0.050, 0.082, -0.034}, 0.0360},   Station{{0.054, 0.058, -0.028}, 0.0435},
    Station{{0.053, 0.028, -0.014}, 0.0445},   Station{{0.047, -0.006, 0.002}, 0.0420},
    Station{{0.034, -0.040, 0.013}, 0.0385},   Station{{0.010, -0.065, 0.019}, 0.0340},
    Station{{-0.020, -0.071, 0.018}, 0.0290},  Station{{-0.047, -0.058, 0.011}, 0.0235},
    Station{{-0.066, -0.039, 0.003}, 0.0170},  Station{{-0.080, -0.023, -0.004}, 0.0150},
    Station{{-0.096, -0.008, -0.012}, 0.0175},
};
// The end of the oesophagus, from above the cardia into the sac.
constexpr std::array kOesophagusStations = {
    Station{{-0.014, 0.118, -0.037}, 0.0125}, Station{{-0.007, 0.096, -0.035}, 0.0125},
    Station{{0.006, 0.075, -0.031}, 0.0135},  Station{{0.024, 0.054, -0.025}, 0.0180},
    Station{{0.042, 0.038, -0.020}, 0.0230},
};
constexpr std::size_t kPiecesPerSpan = 6;

// A straight piece of a centre line: a cone with rounded ends.
struct Piece {
  Vec3d start, along;
  double r, widening;
  // A ball around the whole piece, to leave distant ones out.
  Vec3d middle;
  double reach;
};

Piece piece_between(const Station& a, const Station& b) {
  const Vec3d along = b.p - a.p;
  return {a.p, along, a.r, b.r - a.r, a.p + along * 0.5, length(along) * 0.5 + std::max(a.r, b.r)};
}

// Catmull-Rom spline through the stations, in pieces; beyond the ends the stations are mirrored.
template <std::size_t n>
std::array<Piece, (n - 1) * kPiecesPerSpan> rounded(const std::array<Station, n>& given) {
  const auto at = [&](std::size_t i) {  // counts from the station mirrored before the first
    const auto mirrored = [](const Station& end, const Station& next) {
      return Station{end.p * 2.0 - next.p, end.r * 2.0 - next.r};
    };
    if (i == 0) return mirrored(given[0], given[1]);
    if (i > n) return mirrored(given[n - 1], given[n - 2]);
    return given[i - 1];
  };
  std::array<Piece, (n - 1) * kPiecesPerSpan> pieces{};
  Station before = given[0];
  for (std::size_t k = 0; k < pieces.size(); ++k) {
    const std::size_t span = k / kPiecesPerSpan;
    const double t = static_cast<double>(k % kPiecesPerSpan + 1) / kPiecesPerSpan;
    const double weights[4] = {((2 - t) * t - 1) * t / 2, ((3 * t - 5) * t * t + 2) / 2,
                               ((4 - 3 * t) * t + 1) * t / 2, (t - 1) * t * t / 2};
    Station s{};
    for (std::size_t j = 0; j < 4; ++j) {
      s.p = s.p + at(span + j).p * weights[j];
      s.r += at(span + j).r * weights[j];
    }
    pieces[k] = piece_between(before, s);
    before = s;
  }
  return pieces;
}

// Distance to a chain of pieces. Every sixth comes first, so that the rest are mostly left out.
template <std::size_t n>
double chain(const Vec3d& p, const std::array<Piece, n>& pieces) {
  double least = 1e9;
  for (std::size_t first = 0; first < kPiecesPerSpan; ++first)
    for (std::size_t k = first; k < n; k += kPiecesPerSpan) {
      const Piece& piece = pieces[k];
      const double near = least + piece.reach;
      if (near < 0 || length_squared(p - piece.middle) > near * near) continue;
      const Vec3d offset = p - piece.start;
      const double t = std::clamp(dot(offset, piece.along) / length_squared(piece.along), 0.0, 1.0);
      least = std::min(least, length(offset - piece.along * t) - (piece.r + piece.widening * t));
    }
  return least;
}

// A flat cut through a tube.
struct Cut {
  Vec3d middle, out;  // out: the direction in which the tube goes on, unit length
};
Cut cut_between(const Station& before, const Station& after) {
  return {(before.p + after.p) * 0.5, normalized(after.p - before.p, Vec3d{})};
}
const Cut& cardia() {
  static const Cut cut = cut_between(kOesophagusStations[1], kOesophagusStations[0]);
  return cut;
}
const Cut& pylorus() {
  constexpr std::size_t n = kSacStations.size();
  static const Cut cut = cut_between(kSacStations[n - 2], kSacStations[n - 1]);
  return cut;
}

// Farther from its middle, a cut's plane passes through other parts of the stomach.
constexpr double kCutReach_m = 0.035;

// Positive in what the cut takes away.
double taken_by(const Cut& cut, const Vec3d& p) {
  return std::min(dot(p - cut.middle, cut.out), kCutReach_m - length(p - cut.middle));
}

}  // namespace

double beyond_cardia(const Vec3d& p) {
  return dot(p - cardia().middle, cardia().out);
}

double beyond_pylorus(const Vec3d& p) {
  return dot(p - pylorus().middle, pylorus().out);
}

double stomach_sac_field(const Vec3d& p) {
  static const auto sac = rounded(kSacStations);
  static const auto oesophagus = rounded(kOesophagusStations);
  return smooth_min(chain(p, sac), chain(p, oesophagus), 0.010);
}

double stomach_field(const Vec3d& p) {
  const double sac = stomach_sac_field(p);
  const double wall = std::max(sac, -(sac + kStomachWall_m));
  return std::max({wall, taken_by(cardia(), p), taken_by(pylorus(), p)});
}

mesh::Box stomach_box() {
  return {{-0.115, -0.115, -0.080}, {0.105, 0.125, 0.060}};
}

bool is_stomach_held(const Vec3d& p) {
  constexpr double kRing_m = 0.008;
  return taken_by(cardia(), p) > -kRing_m || taken_by(pylorus(), p) > -kRing_m;
}

}  // namespace trocar::catalogue
