#pragma once

// An identification leaves these for people and programs: the constants as text and as TOML, each
// measured force beside the material's, and two pictures.

#include "common/plot/plot.h"
#include "server/lab/fit/identify.h"

namespace trocar::fit {

// One line per constant with its interval, then the residual.
std::string to_text(const Identification& found);
// A table [hyperelastic] with the constants, SI units in the keys' names.
std::string to_toml(const Identification& found);
// curve,test,time_s,stretch,measured_stress_pa,identified_stress_pa
std::string to_csv(const std::vector<TestCurve>& curves, const Identification& found);
// Nominal stress over time, and over stretch.
plot::Plot plot_over_time(const std::vector<TestCurve>& curves, const Identification& found);
plot::Plot plot_over_stretch(const std::vector<TestCurve>& curves, const Identification& found);

}  // namespace trocar::fit
