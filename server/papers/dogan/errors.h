#pragma once

// A few numbers that stand for the errors of many loads.

#include <vector>

namespace trocar::dogan {

struct Errors {
  double mean = 0, high = 0, worst = 0;  // high: 95 of 100 are not above
};
// All are 0 where there is no value.
Errors errors_of(std::vector<double> values);

}  // namespace trocar::dogan
