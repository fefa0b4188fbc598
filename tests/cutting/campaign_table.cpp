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
constexpr double kWoundOff = 0.05, kSingleWoundOff = 0.1;
constexpr double kSingle_h = 3;  // of the swept area over its rim
constexpr double kMostWaiting = 0.01;

// visit(name, value) of every column.
template <typename Record, typename Visit>
void for_each_column(Record& r, Visit&& visit) {
  visit("organ", r.organ);
  visit("series", r.series);
  visit("length", r.length);
  visit("cut", r.cut);
  visit("kind", r.kind);
  visit("h_m", r.h);
  visit("swept_m2", r.swept);
  visit("rim_m", r.rim);
  visit("wound_m2", r.wound);
  visit("waiting_m2", r.waiting);
  visit("ticks_to_rest", r.ticks_to_rest);
  visit("crosses_ten", r.crosses_ten);
  visit("is_through", r.is_through);
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
  std::uint64_t cuts = 0, ten = 0, through = 0, bridges = 0, broken = 0, series = 0;
  std::uint64_t single = 0, single_off = 0, pinches = 0, crumbs = 0;
  double swept = 0, wound = 0, waiting = 0, drift = 0, margin = 1e9, longest_rest = 0;
  double touched = 0, gained = 0, generic = 0, ones = 0, of_ones = 0, twos = 0, of_twos = 0;
  double cpu_ms = 0, worst_ms = 0;

  void add(const CutRecord& r) {
    ++cuts;
    series += r.cut == 0;
    ten += r.crosses_ten, through += r.is_through, bridges += r.leaves_bridge;
    broken += !r.broken.empty();
    swept += r.swept, wound += r.wound, waiting += r.waiting;
    drift = std::max({drift, r.volume_drift, r.mass_drift});
    margin = std::min(margin, r.angle / r.floor);
    longest_rest = std::max(longest_rest, double(r.ticks_to_rest));
    touched += r.touched, gained += r.gained, generic += r.generic_gained;
    ones += r.ones, of_ones += r.parts_of_ones, twos += r.twos, of_twos += r.parts_of_twos;
    cpu_ms += r.cpu_ms, worst_ms = std::max(worst_ms, r.worst_ms);
    pinches += r.pinches;
    if (r.swept <= 0 || r.swept < kSingle_h * r.h * r.rim) return;
    ++single;
    single_off += std::abs(r.wound / r.swept - 1) > kSingleWoundOff;
  }
};

double ratio(double a, double b) {
  return b > 0 ? a / b : 0;
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
  return line(
      "| %s | %llu | %.1f %% | %.3f | %llu of %llu | %.2f %% | %llu of %llu | %.2f | %.0e | "
      "%.0f | %.2f, %.2f | %.2f, %.2f | %llu |\n",
      name.c_str(), static_cast<unsigned long long>(s.cuts),
      100 * ratio(double(s.ten), double(s.cuts)), ratio(s.wound, s.swept),
      static_cast<unsigned long long>(s.single - s.single_off),
      static_cast<unsigned long long>(s.single), 100 * waiting_share(s),
      static_cast<unsigned long long>(s.bridges), static_cast<unsigned long long>(s.through),
      s.margin, s.drift, s.longest_rest, ratio(s.of_ones, s.ones), ratio(s.of_twos, s.twos),
      ratio(s.gained, s.touched), ratio(s.generic, s.touched),
      static_cast<unsigned long long>(s.broken));
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
      "| | cuts | crossing ten tets | wound over swept | single ones within 10 % | waiting | "
      "bridges of through cuts | least angle over floor | drift of volume, mass | ticks to rest | "
      "parts of a tet cut 1 + 3, 2 + 2 (exact: 4, 6) | new tets per touched one, generic split | "
      "laws broken |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|\n";
  for (const auto& [name, sums] : organs) text += row(name, sums);
  text += row("all", all);
  for (std::size_t k = 0; k < kCutKinds; ++k)
    if (kinds[k].cuts > 0) text += row(name_of(static_cast<CutKind>(k)), kinds[k]);
  for (const auto& [name, sums] : parts) text += row(name, sums);
  text +=
      line("\n%llu series, %llu pinch repairs, %.0f s of CPU in the cutter, worst call %.2f ms\n",
           static_cast<unsigned long long>(all.series),
           static_cast<unsigned long long>(all.pinches), all.cpu_ms / 1e3, all.worst_ms);
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
    broken.push_back(line("%llu wounds are more than 10 %% off",
                          static_cast<unsigned long long>(all.single_off)));
  if (waiting_share(all) > kMostWaiting)
    broken.push_back(line("%.2f %% of the area waits", 100 * waiting_share(all)));
  return broken;
}

}  // namespace trocar::cutting::testing
