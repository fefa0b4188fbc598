// Plots as a person gets them: what was asked for is in the SVG, and no text is taken for a
// command.

#include "common/plot/plot.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <fstream>

#include "common/plot/gnuplot.h"

namespace trocar::plot {
namespace {

Plot sample() {
  Plot plot;
  plot.title = "Force of the tissue";
  plot.x.label = "time (s)";
  plot.y.label = "force (N)";
  plot.series.push_back({"x", {0, 1, 2}, {0, 1, 4}, Style::Line, {}});
  plot.series.push_back({"measured", {0, 1, 2}, {0.1, 0.9, 4.2}, Style::Points, {}});
  return plot;
}

std::string svg_of(const Plot& plot) {
  const auto svg = to_svg(plot);
  EXPECT_TRUE(svg.ok()) << (svg.ok() ? "" : svg.error().message);
  return svg.ok() ? *svg : "";
}

std::size_t count(const std::string& text, const std::string& part) {
  std::size_t n = 0;
  for (auto at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++n;
  return n;
}

TEST(Plot, WhatWasAskedForIsInTheSvg) {
  const std::string svg = svg_of(sample());
  EXPECT_TRUE(svg.starts_with("<?xml")) << svg.substr(0, 200);
  EXPECT_TRUE(svg.find("</svg>") != std::string::npos);
  for (const char* text : {"Force of the tissue", "time (s)", "force (N)", ">measured<"})
    EXPECT_NE(svg.find(text), std::string::npos) << text;
  EXPECT_EQ(svg_of(sample()), svg) << "the same bytes";
}

TEST(Plot, NamesAreTextWhateverTheyHold) {
  const auto marker =
      std::filesystem::temp_directory_path() / ("trocar-plot-" + std::to_string(getpid()));
  const std::string command = "touch " + marker.string();
  Plot plot = sample();
  plot.title = "it's `" + command + "` \"$(" + command + ")\" @x <b>&amp;";
  plot.series[0].name = "'; system('" + command + "'); '\n system '" + command + "'\\";
  plot.x.label = "x_{sub}^2 %s %d";
  plot.y.label = "END\n!" + command;
  const std::string svg = svg_of(plot);
  EXPECT_FALSE(std::filesystem::exists(marker)) << "a name was run as a command";
  EXPECT_NE(svg.find("x_{sub}^2 %s %d"), std::string::npos);
  EXPECT_EQ(svg.find("<b>"), std::string::npos) << "not escaped for XML";
}

TEST(Plot, WhatIsNotFiniteIsAGap) {
  Plot plot = sample();
  plot.series.resize(1);
  plot.series[0].x = {0, 1, 2, 3, 4};
  plot.series[0].y = {0, 1, NAN, 3, INFINITY};
  const std::string svg = svg_of(plot);
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  plot.series[0].y[2] = 2;
  EXPECT_NE(svg_of(plot), svg) << "the gap is seen";
  plot.series[0].y.assign(5, NAN);
  EXPECT_FALSE(to_svg(plot).ok());
  plot.series.clear();
  const auto empty = to_svg(plot);
  ASSERT_FALSE(empty.ok());
  EXPECT_NE(empty.error().message.find("no point to draw"), std::string::npos);
}

TEST(Plot, LogarithmicAxesLeaveOutWhatHasNoLogarithm) {
  Plot plot = sample();
  plot.x.is_logarithmic = plot.y.is_logarithmic = true;
  plot.series[0].x = {0, 1, 1000};
  plot.series[0].y = {-1, 0.001, 1000};
  const std::string svg = svg_of(plot);
  EXPECT_NE(svg.find("1000"), std::string::npos);
}

TEST(Plot, SeriesOfOneNumberShareAColour) {
  Plot plot = sample();
  plot.series[1].style = Style::Line;
  const auto first = count(svg_of(plot), "213,  94,   0");
  EXPECT_GT(first, 0u) << "two colours by default";
  plot.series[1].colour = 0;
  EXPECT_EQ(count(svg_of(plot), "213,  94,   0"), 0u);
}

TEST(Plot, AMissingOrFailingProgramIsSaid) {
  const auto missing = to_svg(sample(), "/nowhere/gnuplot");
  ASSERT_FALSE(missing.ok());
  EXPECT_EQ(missing.error().code, ErrorCode::ResourceMissing);
  EXPECT_NE(missing.error().message.find("gnuplot-nox"), std::string::npos);
  const auto wrong = run_gnuplot("gnuplot", "plot nonsense(x)\n");
  ASSERT_FALSE(wrong.ok());
  EXPECT_NE(wrong.error().message.find("undefined function"), std::string::npos)
      << wrong.error().message;
  EXPECT_EQ(wrong.error().message.find('\n'), std::string::npos);
}

TEST(Plot, TheFileAppearsWholeOrNotAtAll) {
  const auto folder =
      std::filesystem::temp_directory_path() / ("trocar-plot-" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  ASSERT_TRUE(write_svg(folder / "a.svg", sample()).ok());
  std::ifstream file(folder / "a.svg");
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  EXPECT_EQ(text, svg_of(sample()));
  EXPECT_FALSE(write_svg(folder / "none" / "a.svg", sample()).ok());
  EXPECT_FALSE(std::filesystem::exists(folder / "a.svg.part"));
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace trocar::plot
