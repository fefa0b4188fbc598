#include "server/lab/fit/test_curves.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "server/lab/fit/csv_table.h"

namespace trocar::fit {
namespace {

constexpr std::size_t kMinRows = 5;
// Beyond these a number was given in another unit.
constexpr double kLeastStretch = 0.1, kMostStretch = 5;
constexpr double kLeastLargestStrain = 1e-3;
constexpr double kLeastLargestStress_pa = 0.1, kMostStress_pa = 1e8;
constexpr double kLongest_s = 1e6;

struct Test {
  const char* name;
  material::TestMode mode;
  double sign;  // of stretch and force
};
constexpr Test kTests[] = {{"tension", material::TestMode::Uniaxial, 1},
                           {"compression", material::TestMode::Uniaxial, -1},
                           {"equibiaxial", material::TestMode::Equibiaxial, 1},
                           {"shear", material::TestMode::SimpleShear, 1}};

const Test* test_of(std::string_view name) {
  const auto found = std::find_if(std::begin(kTests), std::end(kTests),
                                  [&](const Test& test) { return test.name == name; });
  return found == std::end(kTests) ? nullptr : found;
}

class Reader {
 public:
  Reader(CsvTable table, const SpecimenSize& size) : table_(std::move(table)), size_(size) {}

  Result<std::vector<TestCurve>> read() {
    for (;;) {
      const auto is_row = table_.next();
      if (!is_row) return is_row.error();
      if (!*is_row) break;
      if (auto s = take_row(); !s) return s.error();
    }
    if (curves_.empty()) return wrong("has no measurements");
    for (const auto& curve : curves_)
      if (auto s = check(curve); !s) return s.error();
    return std::move(curves_);
  }

 private:
  Error wrong(const std::string& what) const { return table_.wrong(what); }

  Status take_row() {
    const auto time = table_.number("time_s");
    const auto displacement = table_.number("displacement_mm");
    const auto force = table_.number("force_n");
    if (!time || !displacement || !force)
      return wrong(
          "time_s, displacement_mm and force_n are not all numbers, write them with a decimal "
          "point");
    const std::string name(table_.text("curve"));
    const std::string test = table_.has("test") ? std::string(table_.text("test")) : size_.test;
    const Test* kind = test_of(test);
    if (kind == nullptr)
      return wrong("test '" + test +
                   "' is not known, write tension, compression, equibiaxial or "
                   "shear");
    if (curves_.empty() || curves_.back().name != name || curves_.back().test != test)
      curves_.push_back({name, test, kind->mode, size_.length_m, size_.area_m2, {}, {}, {}});
    TestCurve& curve = curves_.back();
    if (!curve.times_s.empty() && *time <= curve.times_s.back())
      return wrong("time_s is not above the one before, put rows in order of time");
    const double strain = kind->sign * *displacement * 1e-3 / curve.length_m;
    const double stretch = kind->mode == material::TestMode::SimpleShear ? strain : 1 + strain;
    if (kind->mode == material::TestMode::SimpleShear
            ? std::abs(stretch) > kMostStretch
            : !(stretch >= kLeastStretch && stretch <= kMostStretch))
      return wrong(
          implausible("a displacement of %g mm on a length of %g mm is beyond what tissue "
                      "bears: are both in mm?",
                      *displacement, curve.length_m * 1e3));
    curve.times_s.push_back(*time);
    curve.stretches.push_back(stretch);
    curve.stresses_pa.push_back(kind->sign * *force / curve.area_m2);
    return {};
  }

  static std::string implausible(const char* format, double a, double b) {
    char text[200];
    std::snprintf(text, sizeof text, format, a, b);
    return text;
  }

  Status check(const TestCurve& curve) const {
    const std::string which = curve.name.empty() ? "" : "curve " + curve.name + ": ";
    if (curve.times_s.size() < kMinRows) return wrong(which + "has fewer than 5 measurements");
    const double rest = curve.mode == material::TestMode::SimpleShear ? 0 : 1;
    double strain = 0, work = 0;
    for (std::size_t i = 0; i < curve.stretches.size(); ++i) {
      strain = std::max(strain, std::abs(curve.stretches[i] - rest));
      work += (curve.stretches[i] - rest) * curve.stresses_pa[i];
    }
    const double stress = curve.largest_stress_pa();
    if (strain < kLeastLargestStrain)
      return wrong(which + implausible("the largest strain is %.3g of a length of %g mm, too "
                                       "little to measure: is displacement_mm in mm?",
                                       strain, curve.length_m * 1e3));
    if (!(stress >= kLeastLargestStress_pa && stress <= kMostStress_pa))
      return wrong(which + implausible("the largest stress is %.3g Pa on %g mm2, which no tissue "
                                       "has: is force_n in N, and the area in mm2?",
                                       stress, curve.area_m2 * 1e6));
    if (curve.times_s.back() - curve.times_s.front() > kLongest_s)
      return wrong(which + "takes longer than 11 days: is time_s in seconds?");
    if (work <= 0)
      return wrong(which + "the force is against the displacement: check signs, and the test");
    return {};
  }

  CsvTable table_;
  const SpecimenSize& size_;
  std::vector<TestCurve> curves_;
};

const CsvTable::Columns kColumns{{"time_s", "displacement_mm", "force_n"}, {"test", "curve"}};

Result<std::vector<TestCurve>> curves_of(Result<CsvTable> table, const SpecimenSize& size) {
  if (!(size.length_m > 1e-6 && size.length_m < 10) || !(size.area_m2 > 1e-10 && size.area_m2 < 10))
    return Error{ErrorCode::Usage,
                 "the specimen's length and area must be above 0, in mm and mm2, and below 10 m"};
  if (!table) return table.error();
  return Reader(std::move(*table), size).read();
}

}  // namespace

double TestCurve::largest_stress_pa() const {
  double largest = 0;
  for (const double stress : stresses_pa) largest = std::max(largest, std::abs(stress));
  return largest;
}

Result<std::vector<TestCurve>> parse_test_curves(std::string_view text, const std::string& source,
                                                 const SpecimenSize& size) {
  return curves_of(CsvTable::parse(std::string(text), source, kColumns), size);
}

Result<std::vector<TestCurve>> read_test_curves(const std::filesystem::path& path,
                                                const SpecimenSize& size) {
  return curves_of(CsvTable::read(path, kColumns), size);
}

}  // namespace trocar::fit
