#include "server/fit/test_curves.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <optional>
#include <sstream>

#include "server/fit/csv_row.h"

namespace trocar::fit {
namespace {

constexpr std::uintmax_t kLimitBytes = 64u << 20;
constexpr std::size_t kMinRows = 5;
// Beyond these a number was given in another unit.
constexpr double kLeastStretch = 0.1, kMostStretch = 5;
constexpr double kLeastLargestStrain = 1e-3;
constexpr double kLeastLargestStress_pa = 0.1, kMostStress_pa = 1e8;
constexpr double kLongest_s = 1e6;

struct Test {
  const char* name;
  scene::TestMode mode;
  double sign;  // of stretch and force
};
constexpr Test kTests[] = {{"tension", scene::TestMode::Uniaxial, 1},
                           {"compression", scene::TestMode::Uniaxial, -1},
                           {"equibiaxial", scene::TestMode::Equibiaxial, 1},
                           {"shear", scene::TestMode::SimpleShear, 1}};

const Test* test_of(std::string_view name) {
  const auto found = std::find_if(std::begin(kTests), std::end(kTests),
                                  [&](const Test& test) { return test.name == name; });
  return found == std::end(kTests) ? nullptr : found;
}

struct Columns {
  std::optional<std::size_t> time, displacement, force, test, curve;
};

Columns columns_of(const std::vector<std::string_view>& names) {
  Columns columns;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (names[i] == "time_s") columns.time = i;
    if (names[i] == "displacement_mm") columns.displacement = i;
    if (names[i] == "force_n") columns.force = i;
    if (names[i] == "test") columns.test = i;
    if (names[i] == "curve") columns.curve = i;
  }
  return columns;
}

class Parser {
 public:
  Parser(const std::string& source, const SpecimenSize& size) : source_(source), size_(size) {}

  Result<std::vector<TestCurve>> parse(std::string_view text) {
    std::istringstream lines{std::string(text)};
    std::string row;
    for (line_ = 1; std::getline(lines, row); ++line_) {
      const auto cells = cells_of(row);
      if ((cells.size() == 1 && cells[0].empty()) || row.starts_with("#")) continue;
      if (auto s = columns_ ? take_row(cells) : take_header(cells); !s) return s.error();
    }
    line_ = 0;
    if (curves_.empty()) return wrong("has no measurements");
    for (const auto& curve : curves_)
      if (auto s = check(curve); !s) return s.error();
    return std::move(curves_);
  }

 private:
  Error wrong(const std::string& what) const {
    return {ErrorCode::BadFile,
            source_ + (line_ > 0 ? ":" + std::to_string(line_) : "") + ": " + what};
  }

  Status take_header(const std::vector<std::string_view>& cells) {
    columns_ = columns_of(cells);
    if (columns_->time && columns_->displacement && columns_->force) return {};
    return wrong(
        "is no header with the columns time_s, displacement_mm and force_n, write "
        "\"time_s,displacement_mm,force_n\" above the numbers");
  }

  static std::string text_at(const std::vector<std::string_view>& cells,
                             std::optional<std::size_t> column) {
    return column && *column < cells.size() ? std::string(cells[*column]) : "";
  }
  static std::optional<double> number_at(const std::vector<std::string_view>& cells,
                                         std::optional<std::size_t> column) {
    return column && *column < cells.size() ? number_of(cells[*column]) : std::nullopt;
  }

  Status take_row(const std::vector<std::string_view>& cells) {
    const auto time = number_at(cells, columns_->time);
    const auto displacement = number_at(cells, columns_->displacement);
    const auto force = number_at(cells, columns_->force);
    if (!time || !displacement || !force)
      return wrong("time_s, displacement_mm and force_n are not all numbers");
    const std::string name = text_at(cells, columns_->curve);
    const std::string test =
        columns_->test ? text_at(cells, columns_->test) : std::string(size_.test);
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
    const double stretch = kind->mode == scene::TestMode::SimpleShear ? strain : 1 + strain;
    if (kind->mode == scene::TestMode::SimpleShear
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
    const double rest = curve.mode == scene::TestMode::SimpleShear ? 0 : 1;
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

  const std::string& source_;
  const SpecimenSize& size_;
  int line_ = 0;
  std::optional<Columns> columns_;
  std::vector<TestCurve> curves_;
};

}  // namespace

double TestCurve::largest_stress_pa() const {
  double largest = 0;
  for (const double stress : stresses_pa) largest = std::max(largest, std::abs(stress));
  return largest;
}

Result<std::vector<TestCurve>> parse_test_curves(std::string_view text, const std::string& source,
                                                 const SpecimenSize& size) {
  if (!(size.length_m > 1e-6 && size.length_m < 10) || !(size.area_m2 > 1e-10 && size.area_m2 < 10))
    return Error{ErrorCode::Usage,
                 "the specimen's length and area must be above 0, in mm and mm2, and below 10 m"};
  return Parser(source, size).parse(text);
}

Result<std::vector<TestCurve>> read_test_curves(const std::filesystem::path& path,
                                                const SpecimenSize& size) {
  const auto wrong = [&](const std::string& what) {
    return Error{ErrorCode::BadFile, path.string() + ": " + what};
  };
  std::error_code missing;
  const auto bytes = std::filesystem::file_size(path, missing);
  std::ifstream file(path, std::ios::binary);
  if (missing || !file) return wrong("cannot be opened, check name and rights");
  if (bytes > kLimitBytes) return wrong("is larger than 64 MiB, measured curves are not");
  std::ostringstream text;
  text << file.rdbuf();
  return parse_test_curves(text.str(), path.string(), size);
}

}  // namespace trocar::fit
