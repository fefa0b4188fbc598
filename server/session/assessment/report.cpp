#include "server/session/assessment/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>
#include <set>

#include "common/plot/plot.h"
#include "server/session/assessment/html.h"
#include "server/session/assessment/tables.h"

namespace trocar::assessment {
namespace {

constexpr const char* kNotClinical =
    "<p class=\"small\">Measured from the recording by Trocar. The measures say how a session with "
    "a simulator went. They were not checked against people's skill, and are not for clinical "
    "use.</p>\n";

std::string clock_of(double seconds) {
  const auto whole = static_cast<long>(seconds);
  return fmt::format("{}:{:04.1f}", whole / 60, seconds - static_cast<double>(whole / 60 * 60));
}

std::string cell(const std::string& text, bool is_number = false) {
  return std::string(is_number ? "<td class=\"number\">" : "<td>") + html_text(text) + "</td>";
}

const Standing* find(const std::vector<Standing>& standings, const Part& part,
                     std::optional<ToolSlot> tool, const std::string& key) {
  const auto found = std::ranges::find_if(standings, [&](const Standing& standing) {
    return part.stage == standing.stage && standing.tool == tool && standing.key == key;
  });
  return found == standings.end() ? nullptr : &*found;
}

// Points of 100 that a measure brought, of those that it can bring; nothing: it brings none.
std::string points_cell(const Assessment& session, const Part& part, const Figure& figure) {
  const auto& scores = session.lesson->stages[*part.stage].scores;
  const auto score = std::ranges::find_if(
      scores, [&](const auto& each) { return figure.key == lesson::key_of(each.measure); });
  if (score == scores.end()) return "<td></td>";
  const double most = 100.0 / static_cast<double>(scores.size());
  const double points =
      part.result->is_reached ? most * score->points(part.result->value(score->measure)) : 0;
  return cell(fmt::format("{:.0f} of {:.0f}", points, most), true);
}

std::string stage_table(const Assessment& session, const Part& part,
                        const std::vector<Standing>& standings) {
  const bool has_experts = !standings.empty();
  std::string out =
      "<table><tr><th>measure</th><th class=\"number\">value</th>"
      "<th class=\"number\">points</th>";
  if (has_experts)
    out += "<th class=\"number\">experts' median</th><th>better than this part of them</th>";
  out += "</tr>\n";
  for (const auto& figure : figures_of(*part.result)) {
    out += "<tr>" + cell(figure.words) + cell(text_of(figure), true) +
           points_cell(session, part, figure);
    if (has_experts) {
      const auto* standing = find(standings, part, {}, figure.key);
      auto theirs = figure;
      if (standing) theirs.value = standing->median;
      out += standing ? cell(text_of(theirs), true) : "<td></td>";
      out += standing ? fmt::format(
                            "<td><span class=\"bar\" style=\"width:{:.0f}px\"></span> "
                            "{:.0f} %</td>",
                            standing->percentile, standing->percentile)
                      : "<td></td>";
    }
    out += "</tr>\n";
  }
  return out + "</table>\n";
}

// Columns for each tool: its value, and beside it the experts'.
std::string hands_table(const Part& part, const std::vector<Standing>& standings) {
  if (part.hands.empty()) return {};
  std::string out = "<div class=\"wide\"><table><tr><th>hand</th>";
  std::vector<std::pair<std::string, std::string>> rows;  // key, words
  std::vector<std::map<std::string, Figure>> columns;
  for (const auto& hand : part.hands) {
    out += fmt::format("<th class=\"number\">{}, tool {}</th>", html_text(hand.person),
                       hand.tool.number() + 1);
    if (!standings.empty())
      out += "<th class=\"number\">experts' median</th><th class=\"number\">better than</th>";
    auto& column = columns.emplace_back();
    const auto figures = figures_of(hand);
    for (const auto& figure : figures) column[figure.key] = figure;
    // Hands differ in what could not be measured: the fullest list has the order.
    if (figures.size() <= rows.size()) continue;
    rows.clear();
    for (const auto& figure : figures) rows.emplace_back(figure.key, figure.words);
  }
  out += "</tr>\n";
  for (const auto& [key, words] : rows) {
    out += "<tr>" + cell(words);
    for (std::size_t i = 0; i < columns.size(); ++i) {
      const auto found = columns[i].find(key);
      out += cell(found == columns[i].end() ? "" : text_of(found->second), true);
      if (standings.empty()) continue;
      const auto* standing = find(standings, part, part.hands[i].tool, key);
      auto theirs = found == columns[i].end() ? Figure{} : found->second;
      if (standing) theirs.value = standing->median;
      out += cell(standing ? text_of(theirs) : "", true) +
             cell(standing ? fmt::format("{:.0f} %", standing->percentile) : "", true);
    }
    out += "</tr>\n";
  }
  return out + "</table></div>\n";
}

std::string moments_list(const Part& part) {
  if (part.moments.empty()) return "<p>Nothing went wrong that is told by itself.</p>\n";
  std::string out = "<ul>\n";
  for (const auto& moment : part.moments)
    out += "<li>" + clock_of(seconds_of(moment.tick)) + " " +
           html_text(moment.person + (moment.person.empty() ? "" : " ") + moment.text) + "</li>\n";
  if (part.moments_left_out > 0)
    out += fmt::format("<li>and {} more</li>\n", part.moments_left_out);
  return out + "</ul>\n";
}

std::string name_of(const Curve& curve) {
  return fmt::format("{}, tool {}", curve.person, curve.tool.number() + 1);
}

Result<std::string> force_plot(const Assessment& session) {
  plot::Plot plot{.x = {.label = "time (s)"}, .y = {.label = "force (N)", .low = 0}};
  plot.height_px = 360;
  for (const auto& curve : session.curves)
    plot.series.push_back({.name = name_of(curve), .x = curve.time_s, .y = curve.force_n});
  for (const auto& part : session.stages) {
    if (!part.stage) continue;
    const double limit_n = session.lesson->stages[*part.stage].force_limit_n;
    if (limit_n <= 0) continue;
    plot.series.push_back({.name = part.stage == session.stages.front().stage ? "limit" : "",
                           .x = {seconds_of(part.begin), seconds_of(part.end)},
                           .y = {limit_n, limit_n},
                           .style = plot::Style::Dashed,
                           .colour = 6});
  }
  return plot::to_svg(plot);
}

Result<std::string> blood_plot(const Assessment& session) {
  plot::Plot plot{.x = {.label = "time (s)"}, .y = {.label = "blood lost (ml)", .low = 0}};
  plot.height_px = 300;
  plot.series.push_back({.name = {}, .x = session.blood.time_s, .y = session.blood.lost_ml});
  return plot::to_svg(plot);
}

// Scales are equal; `up` is the world's axis that the plot has upwards.
Result<std::string> way_plot(const Assessment& session, const std::string& label, double Vec3d::*up,
                             double sign) {
  constexpr double kFar = std::numeric_limits<double>::max();
  plot::Plot plot{.x = {.label = "x, to the right (mm)"}, .y = {.label = label}};
  plot.width_px = plot.height_px = 560;
  double low_x = kFar, low_y = kFar, high_x = -kFar, high_y = -kFar;
  for (const auto& curve : session.curves) {
    auto& series = plot.series.emplace_back();
    series.name = name_of(curve);
    for (const auto& tip : curve.tip_m) {
      const double x = tip.x * 1e3, y = sign * tip.*up * 1e3;
      series.x.push_back(x), series.y.push_back(y);
      low_x = std::min(low_x, x), low_y = std::min(low_y, y);
      high_x = std::max(high_x, x), high_y = std::max(high_y, y);
    }
  }
  const double half = 0.55 * std::max({high_x - low_x, high_y - low_y, 10.0});
  plot.x.low = (low_x + high_x) / 2 - half, plot.x.high = (low_x + high_x) / 2 + half;
  plot.y.low = (low_y + high_y) / 2 - half, plot.y.high = (low_y + high_y) / 2 + half;
  return plot::to_svg(plot);
}

std::string figure(const std::string& svg, const std::string& words) {
  return "<figure class=\"plot\">" + html_image("image/svg+xml", svg, words) +
         "<figcaption class=\"small\">" + html_text(words) + "</figcaption></figure>\n";
}

std::string people_of(const Assessment& session) {
  std::set<std::string> people;
  for (const auto& hand : session.whole.hands)
    if (!hand.person.empty()) people.insert(hand.person);
  std::string out;
  for (const auto& person : people) out += (out.empty() ? "" : ", ") + person;
  return out;
}

}  // namespace

Result<std::string> report_of(const Assessment& session, const std::vector<Standing>& standings,
                              const std::vector<Picture>& pictures) {
  const auto title = session.lesson ? session.lesson->title : "Session";
  std::string body = "<h1>" + html_text(title) + "</h1>\n";
  body += "<p>" + html_text(people_of(session)) + "<br><span class=\"small\">" +
          html_text(fmt::format("{}, {} UTC, organ {}, {}", session.name,
                                iso_time(session.start_utc_ns), session.organ,
                                clock_of(session.whole.seconds()))) +
          "</span></p>\n";
  if (session.lesson)
    body += fmt::format("<p><span class=\"points\">{:.0f}</span> of 100 points{}</p>\n",
                        session.points, session.is_over ? "" : ". The lesson was not over.");
  for (const auto& note : session.notes) body += "<p class=\"note\">" + html_text(note) + "</p>\n";
  for (const auto& part : session.stages) {
    body += "<h2>" + html_text(part.name) + "</h2>\n";
    if (part.stage) body += "<p>" + html_text(session.lesson->stages[*part.stage].text) + "</p>\n";
    body += "<p>" +
            (part.result ? fmt::format("{} with {:.0f} of 100 points",
                                       part.result->is_reached ? "Reached" : "Not reached",
                                       part.result->points)
                         : std::string("Not over")) +
            ", from " + clock_of(seconds_of(part.begin)) + " to " + clock_of(seconds_of(part.end)) +
            ".</p>\n";
    if (part.result && part.stage) body += stage_table(session, part, standings);
    body += moments_list(part) + hands_table(part, standings);
  }
  if (!pictures.empty()) {
    body += "<h2>Moments that cost points</h2>\n<div class=\"pictures\">\n";
    for (const auto& picture : pictures)
      body += "<figure>" +
              html_image("image/png", picture.png,
                         "The tissue at " + clock_of(seconds_of(picture.tick))) +
              "<figcaption>" + clock_of(seconds_of(picture.tick)) + "</figcaption></figure>\n";
    body += "</div>\n";
  }
  body += "<h2>Whole session</h2>\n";
  if (!session.curves.empty()) {
    const auto forces = force_plot(session);
    if (!forces) return forces.error();
    const auto front = way_plot(session, "y, up (mm)", &Vec3d::y, 1);
    if (!front) return front.error();
    const auto above = way_plot(session, "away from the viewer (mm)", &Vec3d::z, -1);
    if (!above) return above.error();
    body +=
        figure(*forces, "Force of the tissue on each tool, the greatest of each quarter second") +
        "<div class=\"pair\">" + figure(*front, "Way of the tips, seen from the front") +
        figure(*above, "The same, seen from above") + "</div>\n";
  }
  if (!session.blood.lost_ml.empty() && session.blood.lost_ml.back() > 0) {
    const auto blood = blood_plot(session);
    if (!blood) return blood.error();
    body += figure(*blood, "Blood lost since the session began");
  }
  if (session.strain)
    for (const auto& line : lines_of(*session.strain)) body += "<p>" + html_text(line) + ".</p>\n";
  if (session.stages.empty()) body += moments_list(session.whole);
  body += hands_table(session.whole, {}) + kNotClinical;
  return html_page(title, body);
}

Result<std::string> learning_report_of(const std::vector<Assessment>& sessions) {
  // By lesson and by who took part, in the order of time.
  std::map<std::string, std::map<std::string, std::vector<const Assessment*>>> courses;
  for (const auto& session : sessions)
    if (session.lesson) courses[session.lesson->title][people_of(session)].push_back(&session);
  std::string body = "<h1>Learning curves</h1>\n";
  if (courses.empty()) body += "<p>No recording here has a lesson.</p>\n";
  for (auto& [title, teams] : courses) {
    body += "<h2>" + html_text(title) + "</h2>\n";
    plot::Plot plot{.x = {.label = "session", .low = 0.5},
                    .y = {.label = "points", .low = 0, .high = 100}};
    plot.height_px = 360;
    std::string rows;
    for (auto& [people, runs] : teams) {
      std::ranges::stable_sort(runs, {}, &Assessment::start_utc_ns);
      auto& series = plot.series.emplace_back();
      series.name = people, series.style = plot::Style::LineAndPoints;
      for (std::size_t i = 0; i < runs.size(); ++i) {
        series.x.push_back(static_cast<double>(i + 1));
        series.y.push_back(runs[i]->points);
        rows += "<tr>" + cell(people) + cell(std::to_string(i + 1), true) +
                cell(iso_time(runs[i]->start_utc_ns)) +
                cell(fmt::format("{:.0f}", runs[i]->points), true) +
                cell(clock_of(runs[i]->whole.seconds()), true) + cell(runs[i]->name) + "</tr>\n";
      }
    }
    const auto svg = plot::to_svg(plot);
    if (!svg) return svg.error();
    body += figure(*svg, "Points from session to session") +
            "<table><tr><th>people</th><th class=\"number\">session</th><th>begun (UTC)</th>"
            "<th class=\"number\">points</th><th class=\"number\">length</th><th>file</th></tr>\n" +
            rows + "</table>\n";
  }
  return html_page("Learning curves", body + kNotClinical);
}

}  // namespace trocar::assessment
