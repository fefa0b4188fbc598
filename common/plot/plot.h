#pragma once

// Line and point plots as SVG, drawn by gnuplot: white ground, sans-serif, colours that the colour
// blind tell apart, a legend below. The same plot gives the same bytes (with the same gnuplot).
//
// Any text is safe: names reach gnuplot quoted, on its standard input; no shell is involved. Points
// with a value that is not finite are gaps in a line; on a logarithmic axis so are those that are
// not positive. Blocks until gnuplot is done (tens of milliseconds); any thread.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"

namespace trocar::plot {

enum class Style { Line, Dashed, Points, LineAndPoints };

struct Axis {
  std::string label;  // with the unit: "force (N)"
  bool is_logarithmic = false;
  std::optional<double> low, high;  // otherwise as the data need
};

struct Series {
  std::string name;          // in the legend; empty: not in it
  std::vector<double> x, y;  // equally many
  Style style = Style::Line;
  // Series with the same number have the same colour; without: the next one of the palette.
  std::optional<int> colour;
};

struct Plot {
  std::string title;  // empty: none
  Axis x, y;
  std::vector<Series> series;
  int width_px = 800, height_px = 500;
};

// Error: no point to draw, or gnuplot is missing or failed; `gnuplot` is the program's name or
// path.
Result<std::string> to_svg(const Plot& plot, const std::string& gnuplot = "gnuplot");
// The file appears complete or not at all.
Status write_svg(const std::filesystem::path& path, const Plot& plot);

}  // namespace trocar::plot
