#include "tests/cutting/campaign_table.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <functional>
#include <sstream>

namespace trocar::cutting::testing {
namespace {

constexpr double kLeastCrossingTen = 0.9;
constexpr double kWoundOff = 0.05, kWideWoundOff = 0.1;
constexpr double kWide_h = 3;  // of the swept area over its perimeter
// Later strokes of a series meet crumbs that are not cut any further (Settings::whole_volume_h3):
// they are shown, but only these are held to it.
constexpr std::uint32_t kSingleStrokes = 10;
constexpr double kMostWaiting = 0.01;

// Calls visit(name, value) for every column.
template <typename Record, typename Visit>
void for_each_column(Record& r, Visit&& visit) {
  visit("organ", r.organ);
  visit("series", r.series);
  visit("length", r.length);
  visit("cut", r.cut);
  visit("kind", r.kind);
  visit("h_m", r.h);
  visit("swept_m2", r.swept);
  visit("perimeter_m", r.perimeter);
  visit("wound_m2", r.wound);
  visit("waiting_m2", r.waiting);
  visit("ticks_to_rest", r.ticks_to_rest);
  visit("crosses_ten", r.crosses_ten);
  visit("leaves_bridge", r.leaves_bridge);
  visit("tets", r.tets);
  visit("nodes", r.nodes);
  visit("bytes", r.bytes);
  visit("pieces", r.pieces);
  visit("crumbs", r.crumbs);
  visit("splits", r.splits);
  visit("labels", r.labels);
  visit("refused", r.refused);
  visit("pinches", r.pinches);
  visit("angle_deg", r.angle);
  visit("floor_deg", r.floor);
  visit("volume_drift", r.volume_drift);
  visit("mass_drift", r.mass_drift);
  visit("cpu_ms", r.cpu_ms);
  visit("worst_ms", r.worst_ms);
  visit("touched", r.touched);
  visit("gained", r.gained);
  visit("generic_gained", r.generic_gained);
  visit("ones", r.ones);
  visit("parts_of_ones", r.parts_of_ones);
  visit("twos", r.twos);
  visit("parts_of_twos", r.parts_of_twos);
  visit("broken", r.broken);
}

bool parse(const std::string& text, std::string& value) {
  value = text;
  return true;
}
bool parse(const std::string& text, bool& value) {
  value = text == "1";
  return text == "0" || text == "1";
}
template <typename Number>
bool parse(const std::string& text, Number& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size();
}

std::optional<CutRecord> parse_line(const std::string& line) {
  CutRecord record;
  std::istringstream in(line + ',');
  std::string cell;
  bool ok = true;
  for_each_column(record, [&](const char*, auto& value) {
    ok = ok && std::getline(in, cell, ',') && parse(cell, value);
  });
  if (!ok || record.kind >= kCutKinds) return std::nullopt;
  return record;
}

struct Sums {
  unsigned long long cuts = 0, ten = 0, through = 0, bridges = 0, broken = 0, series = 0;
  unsigned long long wide = 0, wide_off = 0, single_off = 0, pinches = 0;
  double swept = 0, wound = 0, waiting = 0, drift = 0, margin = 1e9;
  std::uint32_t longest_rest = 0;
  double touched = 0, gained = 0, generic = 0, ones = 0, of_ones = 0, twos = 0, of_twos = 0;
  double cpu_ms = 0, worst_ms = 0;
  std::vector<double> ratios;

  void add(const CutRecord& r) {
    ++cuts;
    series += r.cut == 0;
    ten += r.crosses_ten, through += r.kind == static_cast<std::uint32_t>(CutKind::Through),
        bridges += r.leaves_bridge;
    broken += !r.broken.empty();
    swept += r.swept, wound += r.wound, waiting += r.waiting;
    drift = std::max({drift, r.volume_drift, r.mass_drift});
    margin = std::min(margin, r.angle / r.floor);
    longest_rest = std::max(longest_rest, r.ticks_to_rest);
    touched += r.touched, gained += r.gained, generic += r.generic_gained;
    ones += r.ones, of_ones += r.parts_of_ones, twos += r.twos, of_twos += r.parts_of_twos;
    cpu_ms += r.cpu_ms, worst_ms = std::max(worst_ms, r.worst_ms);
    pinches += r.pinches;
    if (r.swept > r.h * r.h) ratios.push_back(r.wound / r.swept);
    if (r.swept <= 0 || r.swept < kWide_h * r.h * r.perimeter) return;
    ++wide;
    const bool is_off = std::abs(r.wound / r.swept - 1) > kWideWoundOff;
    wide_off += is_off;
    single_off += is_off && r.cut < kSingleStrokes;
  }
};

double ratio(double a, double b) {
  return b > 0 ? a / b : 0;
}
double percentile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}
double waiting_share(const Sums& s) {
  return ratio(s.waiting, s.waiting + s.wound);
}

template <typename... Values>
std::string line(const char* format, const Values&... values) {
  char text[512];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}

std::string row(const std::string& name, const Sums& s) {
  const std::vector<std::string> cells = {
      name,
      line("%llu", s.cuts),
      line("%.1f %%", 100 * ratio(double(s.ten), double(s.cuts))),
      line("%.3f", ratio(s.wound, s.swept)),
      line("%.2f to %.2f", percentile(s.ratios, 0.1), percentile(s.ratios, 0.9)),
      line("%llu of %llu", s.wide - s.wide_off, s.wide),
      line("%.2f %%", 100 * waiting_share(s)),
      line("%llu of %llu", s.bridges, s.through),
      line("%.2f", s.margin),
      line("%.0e", s.drift),
      line("%u", s.longest_rest),
      line("%.2f, %.2f", ratio(s.of_ones, s.ones), ratio(s.of_twos, s.twos)),
      line("%.2f, %.2f", ratio(s.gained, s.touched), ratio(s.generic, s.touched)),
      line("%llu", s.broken)};
  std::string text = "|";
  for (const auto& cell : cells) text += ' ' + cell + " |";
  return text + '\n';
}

const char* part_of_series(std::uint32_t cut) {
  return cut == 0    ? "1st of its series"
         : cut < 10  ? "2nd to 10th"
         : cut < 30  ? "11th to 30th"
         : cut < 100 ? "31st to 100th"
                     : "later";
}

}  // namespace

std::string csv_header() {
  std::string header;
  CutRecord record;
  for_each_column(record, [&](const char* name, auto&) {
    if (!header.empty()) header += ',';
    header += name;
  });
  return header + '\n';
}

std::string csv_line(const CutRecord& record) {
  std::ostringstream out;
  out.precision(9);
  bool is_first = true;
  for_each_column(record, [&](const char*, const auto& value) {
    if (!is_first) out << ',';
    is_first = false;
    out << value;
  });
  return out.str() + '\n';
}

void CampaignTable::add(const CutRecord& record) {
  records_[{record.organ, record.series, record.cut}] = record;
}

Status CampaignTable::read(const std::filesystem::path& csv) {
  std::ifstream in(csv);
  std::string text;
  if (!std::getline(in, text) || text + '\n' != csv_header())
    return Error{ErrorCode::BadFile, csv.string() + ": not a record of this campaign"};
  while (std::getline(in, text))
    if (const auto record = parse_line(text)) add(*record);
  return {};
}

bool CampaignTable::has_series(const std::string& organ, std::uint64_t number) const {
  const auto first = records_.find({organ, number, 0});
  return first != records_.end() && records_.count({organ, number, first->second.length - 1}) > 0;
}

std::string CampaignTable::text() const {
  std::map<std::string, Sums> organs, parts;
  std::array<Sums, kCutKinds> kinds;
  Sums all;
  for (const auto& [key, record] : records_) {
    for (auto* const sums :
         {&organs[record.organ], &kinds[record.kind], &parts[part_of_series(record.cut)], &all})
      sums->add(record);
  }
  std::string text =
      "| | cuts | crossing ten tets | wound over swept | of single cuts, 10th to 90th percentile | "
      "wide ones within 10 % | waiting | "
      "bridges of through cuts | least angle over floor | drift of volume, mass | ticks to rest | "
      "parts of a tet cut 1 + 3, 2 + 2 (exact: 4, 6) | new tets per touched one, generic split | "
      "laws broken |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n";
  for (const auto& [name, sums] : organs) text += row(name, sums);
  text += row("all", all);
  for (std::size_t k = 0; k < kCutKinds; ++k)
    if (kinds[k].cuts > 0) text += row(name_of(static_cast<CutKind>(k)), kinds[k]);
  for (const auto& [name, sums] : parts) text += row(name, sums);
  text +=
      line("\n%llu series, %llu pinch repairs, %.0f s of CPU in the cutter, worst call %.2f ms\n",
           all.series, all.pinches, all.cpu_ms / 1e3, all.worst_ms);
  return text;
}

std::vector<std::string> CampaignTable::broken_laws() const {
  std::vector<std::string> broken;
  Sums all;
  for (const auto& [key, record] : records_) {
    all.add(record);
    const auto where = record.organ + ", series " + std::to_string(record.series) + ", cut " +
                       std::to_string(record.cut) + ", " +
                       name_of(static_cast<CutKind>(record.kind)) + ": ";
    if (!record.broken.empty()) broken.push_back(where + record.broken);
    if (record.leaves_bridge) broken.push_back(where + "a bridge is left");
  }
  if (double(all.ten) < kLeastCrossingTen * double(all.cuts))
    broken.push_back("too few cuts cross ten tets");
  if (std::abs(ratio(all.wound, all.swept) - 1) > kWoundOff)
    broken.push_back(line("wound over swept area is %.3f", ratio(all.wound, all.swept)));
  if (all.single_off > 0)
    broken.push_back(line("%llu wide wounds are more than 10 %% off", all.single_off));
  if (waiting_share(all) > kMostWaiting)
    broken.push_back(line("%.2f %% of the area waits", 100 * waiting_share(all)));
  return broken;
}

}  // namespace trocar::cutting::testing
