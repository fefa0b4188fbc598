#include "common/plot/plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "common/base/assert.h"
#include "common/base/text_file.h"
#include "common/plot/gnuplot.h"

namespace trocar::plot {
namespace {

// Okabe and Ito's colours without their yellow, which is faint on white.
constexpr std::array kPalette{"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                              "#e69f00", "#56b4e9", "#000000"};

// Between single quotes gnuplot interprets nothing but quotes, and its reading of doubled ones
// fails where one comes first: they are written as apostrophes.
std::string quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : text) {
    if (c == '\'')
      out += "\u2019";
    else
      out += static_cast<unsigned char>(c) < 32 || c == 127 ? ' ' : c;
  }
  return out + "'";
}

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", value);
  return text;
}

bool is_drawn(const Axis& axis, double value) {
  return std::isfinite(value) && (!axis.is_logarithmic || value > 0);
}

void add_axis(std::string& script, char name, const Axis& axis) {
  script += std::string("set ") + name + "label " + quoted(axis.label) + "\n";
  if (axis.is_logarithmic) {
    script += std::string("set logscale ") + name + " 10\n";
    script += std::string("set format ") + name + " '%g'\n";
  }
  script += std::string("set ") + name + "range [" + (axis.low ? number(*axis.low) : "*") + ":" +
            (axis.high ? number(*axis.high) : "*") + "]\n";
}

// Returns whether there is a point to draw.
bool add_data(std::string& script, const Plot& plot, std::size_t index) {
  const Series& series = plot.series[index];
  TROCAR_ASSERT(series.x.size() == series.y.size());
  bool has_points = false;
  script += "$d" + std::to_string(index) + " << END\n";
  for (std::size_t i = 0; i < series.x.size(); ++i) {
    const bool is_point = is_drawn(plot.x, series.x[i]) && is_drawn(plot.y, series.y[i]);
    has_points |= is_point;
    // An empty line ends a piece of the line.
    script += is_point ? number(series.x[i]) + " " + number(series.y[i]) + "\n" : "\n";
  }
  script += "END\n";
  return has_points;
}

std::string drawn_as(const Series& series, std::size_t colour) {
  const std::string rgb = std::string(" lc rgb '") + kPalette[colour % kPalette.size()] + "'";
  switch (series.style) {
    case Style::Line:
      return "with lines lw 2 dt 1" + rgb;
    case Style::Dashed:
      return "with lines lw 2 dt (10,6)" + rgb;
    case Style::Points:
      return "with points pt 7 ps 0.5" + rgb;
    case Style::LineAndPoints:
      return "with linespoints lw 2 pt 7 ps 0.5" + rgb;
  }
  return "with lines" + rgb;
}

}  // namespace

Result<std::string> to_svg(const Plot& plot, const std::string& gnuplot) {
  std::string script = "set encoding utf8\nset terminal svg size " + std::to_string(plot.width_px) +
                       "," + std::to_string(plot.height_px) +
                       " dynamic noenhanced font 'sans-serif,14' background '#ffffff'\n"
                       "set border 3 lc rgb '#404040'\nset tics nomirror textcolor rgb '#000000'\n"
                       "set grid lc rgb '#d8d8d8' lw 1 dt 1\nset key below noenhanced\n";
  if (!plot.title.empty()) script += "set title " + quoted(plot.title) + "\n";
  add_axis(script, 'x', plot.x);
  add_axis(script, 'y', plot.y);
  std::string commands;
  std::size_t next_colour = 0;
  for (std::size_t i = 0; i < plot.series.size(); ++i) {
    const Series& series = plot.series[i];
    const auto colour =
        series.colour ? static_cast<std::size_t>(std::max(*series.colour, 0)) : next_colour++;
    if (!add_data(script, plot, i)) continue;
    commands += (commands.empty() ? "plot $d" : ", $d") + std::to_string(i) + " using 1:2 " +
                (series.name.empty() ? "notitle" : "title " + quoted(series.name)) + " " +
                drawn_as(series, colour);
  }
  if (commands.empty())
    return Error{ErrorCode::Usage, "plot '" + plot.title + "': has no point to draw"};
  return run_gnuplot(gnuplot, script + commands + "\n");
}

Status write_svg(const std::filesystem::path& path, const Plot& plot) {
  const auto svg = to_svg(plot);
  if (!svg) return svg.error();
  return write_text_file(path, *svg);
}

}  // namespace trocar::plot
