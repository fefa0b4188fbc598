#include "server/session/assessment/figures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace trocar::assessment {
namespace {

constexpr double kLeastPathM = 1e-3;

// This is a figure's place in a lesson.
using Place = std::tuple<std::size_t, int, std::string>;  // stage, tool or -1, key

template <typename Visit>
void for_each_figure(const Assessment& session, Visit visit) {
  for (const auto& part : session.stages) {
    if (!part.stage || !part.result) continue;
    for (const auto& figure : figures_of(*part.result))
      visit(Place{*part.stage, -1, figure.key}, figure);
    for (const auto& hand : part.hands)
      for (const auto& figure : figures_of(hand))
        visit(Place{*part.stage, hand.tool.value, figure.key}, figure);
  }
}

double median_of(std::vector<double> values) {
  std::ranges::sort(values);
  const auto middle = values.size() / 2;
  return values.size() % 2 == 1 ? values[middle] : (values[middle - 1] + values[middle]) / 2;
}

}  // namespace

std::string text_of(const Figure& figure) {
  const auto number = fmt::format("{:.{}f}", figure.value, figure.digits);
  return figure.unit.empty() ? number : number + " " + figure.unit;
}

std::vector<Figure> figures_of(const lesson::StageResult& result) {
  std::vector<Figure> figures;
  for (int i = 0; i < lesson::kMeasures; ++i) {
    const auto measure = static_cast<lesson::Measure>(i);
    const double value = result.value(measure);
    if (std::isnan(value)) continue;
    figures.push_back({.key = lesson::key_of(measure),
                       .words = lesson::words_of(measure),
                       .unit = lesson::unit_of(measure),
                       .value = lesson::in_unit(measure, value),
                       .digits = lesson::digits_of(measure),
                       .better = Better::Less});
  }
  return figures;
}

std::vector<Figure> figures_of(const Hand& hand) {
  const auto& skill = hand.skill;
  std::vector<Figure> figures{
      {"present_s", "time with this tool", "s", skill.seconds, 1, Better::Neither},
      {"idle_s", "idle", "s", skill.idle_s, 1},
      {"path_m", "way of the tip", "m", skill.path_m, 3},
      {"working_volume_cm3", "working volume", "cm³", skill.working_volume_m3 * 1e6, 1},
      {"movements", "movements", "", static_cast<double>(skill.movements), 0, Better::Neither},
      {"peak_force_n", "greatest force", "N", skill.peak_n, 2},
      {"mean_force_n", "mean force", "N", skill.mean_n, 2},
      {"time_above_limit_s", "time with too much force", "s", skill.above_limit_s, 1},
      {"work_mj", "work on the tissue", "mJ", skill.work_j * 1e3, 1},
      {"grasps", "grasps", "", static_cast<double>(hand.grasps), 0, Better::Neither},
      {"cuts", "cuts begun", "", static_cast<double>(hand.cuts), 0, Better::Neither},
      {"refusals", "refused", "", static_cast<double>(hand.refusals), 0},
      {"lost_grasps", "lost grasps", "", static_cast<double>(hand.losses), 0},
      {"waited_s", "waited for others", "s", hand.waited_s, 1}};
  const auto insert = [&](Figure figure) {
    figures.insert(figures.begin() + 3, std::move(figure));
  };
  if (skill.smoothness)
    insert({"smoothness", "smoothness", "", *skill.smoothness, 2, Better::More});
  // A hand at rest has no economy.
  if (skill.path_m >= kLeastPathM)
    insert({"economy", "economy of motion", "", skill.economy, 2, Better::More});
  return figures;
}

Result<std::vector<Standing>> compare(const Assessment& session,
                                      const std::vector<Assessment>& experts) {
  std::map<Place, std::vector<double>> theirs;
  for (const auto& expert : experts) {
    if (!session.lesson || !expert.lesson || session.lesson->title != expert.lesson->title ||
        session.lesson->stages.size() != expert.lesson->stages.size())
      return Error{ErrorCode::BadFile,
                   "--expert: " + expert.file + ": gave another lesson than " + session.file};
    for_each_figure(expert, [&](const Place& place, const Figure& figure) {
      theirs[place].push_back(figure.value);
    });
  }
  std::vector<Standing> standings;
  for_each_figure(session, [&](const Place& place, const Figure& figure) {
    const auto found = theirs.find(place);
    if (found == theirs.end() || figure.better == Better::Neither) return;
    const auto& [stage, tool, key] = place;
    double worse = 0;
    for (const double value : found->second) {
      const bool is_worse =
          figure.better == Better::Less ? value > figure.value : value < figure.value;
      worse += value == figure.value ? 0.5 : is_worse ? 1 : 0;
    }
    auto& standing = standings.emplace_back();
    standing.stage = stage;
    if (tool >= 0) standing.tool = ToolSlot{static_cast<std::uint8_t>(tool)};
    standing.key = key;
    standing.median = median_of(found->second);
    standing.percentile = 100 * worse / static_cast<double>(found->second.size());
    standing.experts = found->second.size();
  });
  return standings;
}

}  // namespace trocar::assessment
