#include "server/lab/fit/identify_report.h"

#include <cstdarg>
#include <cstdio>

#include "common/base/quote.h"
#include "server/lab/fit/csv_table.h"

namespace trocar::fit {
namespace {

[[gnu::format(printf, 1, 2)]] std::string format(const char* pattern, ...) {
  char text[240];
  va_list arguments;
  va_start(arguments, pattern);
  std::vsnprintf(text, sizeof text, pattern, arguments);
  va_end(arguments);
  return text;
}

std::string label_of(const TestCurve& curve) {
  return curve.name.empty() ? curve.test : curve.name + " (" + curve.test + ")";
}

// Measured points and the identified line of each curve, in one colour.
plot::Plot plot_of(const std::vector<TestCurve>& curves, const Identification& found,
                   const std::vector<double> TestCurve::*x) {
  plot::Plot plot{.title = found.material.name, .y = {"nominal stress (Pa)"}};
  for (std::size_t i = 0; i < curves.size(); ++i) {
    const auto& at = curves[i].*x;
    const int colour = static_cast<int>(i);
    plot.series.push_back({label_of(curves[i]) + ", measured", at, curves[i].stresses_pa,
                           plot::Style::Points, colour});
    plot.series.push_back({label_of(curves[i]) + ", identified", at, found.stresses_pa[i],
                           plot::Style::Line, colour});
  }
  return plot;
}

}  // namespace

std::string to_text(const Identification& found) {
  std::string text;
  for (const auto& c : found.constants) {
    text += format("%-5s %12.6g %-2s", c.name.c_str(), c.value, c.unit.c_str());
    text += c.is_determined ? format("  (95 %%: %.6g to %.6g)\n", c.low, c.high)
                            : "  (not determined)\n";
  }
  return text + format("residual %.3g %% rms of each curve's largest stress, %d evaluations\n",
                       found.rms_percent, found.evaluations);
}

std::string to_toml(const Identification& found) {
  const auto& m = found.material;
  std::string text = "[hyperelastic]\nname = " + quote(m.name) + "\n";
  text += m.split == material::VolumeSplit::Isochoric ? "form = \"isochoric\"\n"
                                                      : "form = \"unsplit\"\n";
  text += "c_i0_pa = [";
  for (std::size_t i = 0; i < m.coefficients_pa.size(); ++i)
    text += format("%s%.9g", i == 0 ? "" : ", ", m.coefficients_pa[i]);
  text += format("]\nbulk_modulus_pa = %.9g\nweights = [", m.bulk_modulus_pa);
  for (std::size_t k = 0; k < m.relaxation.size(); ++k)
    text += format("%s%.9g", k == 0 ? "" : ", ", m.relaxation[k].weight);
  text += "]\nrelaxation_times_s = [";
  for (std::size_t k = 0; k < m.relaxation.size(); ++k)
    text += format("%s%.9g", k == 0 ? "" : ", ", m.relaxation[k].relaxation_time_s);
  return text + "]\n";
}

std::string to_csv(const std::vector<TestCurve>& curves, const Identification& found) {
  std::string text = "curve,test,time_s,stretch,measured_stress_pa,identified_stress_pa\n";
  for (std::size_t i = 0; i < curves.size(); ++i)
    for (std::size_t row = 0; row < curves[i].times_s.size(); ++row)
      text += csv_cell(curves[i].name) + "," + curves[i].test +
              format(",%.9g,%.9g,%.9g,%.9g\n", curves[i].times_s[row], curves[i].stretches[row],
                     curves[i].stresses_pa[row], found.stresses_pa[i][row]);
  return text;
}

plot::Plot plot_over_time(const std::vector<TestCurve>& curves, const Identification& found) {
  auto plot = plot_of(curves, found, &TestCurve::times_s);
  plot.x.label = "time (s)";
  return plot;
}

plot::Plot plot_over_stretch(const std::vector<TestCurve>& curves, const Identification& found) {
  auto plot = plot_of(curves, found, &TestCurve::stretches);
  plot.x.label = "stretch";
  return plot;
}

}  // namespace trocar::fit
