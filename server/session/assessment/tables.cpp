#include "server/session/assessment/tables.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <set>

#include "common/base/checksum.h"
#include "common/base/json.h"
#include "server/session/recording/csv_text.h"

namespace trocar::assessment {
namespace {

Json json_of(const Part& part) {
  Json json = {
      {"name", part.name}, {"begin_s", seconds_of(part.begin)}, {"end_s", seconds_of(part.end)}};
  if (part.result) {
    json["is_reached"] = part.result->is_reached;
    json["points"] = part.result->points;
    Json measures = Json::object();
    for (const auto& figure : figures_of(*part.result)) measures[figure.key] = figure.value;
    json["measures"] = measures;
  }
  Json hands = Json::array();
  for (const auto& hand : part.hands) {
    Json entry = {{"tool", hand.tool.value}, {"person", hand.person}};
    for (const auto& figure : figures_of(hand)) entry[figure.key] = figure.value;
    hands.push_back(entry);
  }
  json["hands"] = hands;
  Json moments = Json::array();
  for (const auto& moment : part.moments)
    moments.push_back(
        {{"time_s", seconds_of(moment.tick)}, {"person", moment.person}, {"text", moment.text}});
  json["moments"] = moments;
  json["moments_left_out"] = part.moments_left_out;
  return json;
}

// An identifier made from text: the same text has the same one (RFC 9562, version 8).
std::string uuid_of(const std::string& text) {
  const auto high = hex64(xxh3_64(bytes_of(std::string_view(text))));
  const auto low = hex64(xxh3_64(bytes_of(std::string_view("low " + text))));
  return fmt::format("{}-{}-8{}-a{}-{}", high.substr(0, 8), high.substr(8, 4), high.substr(13, 3),
                     low.substr(1, 3), low.substr(4, 12));
}

// Small letters, digits and hyphens.
std::string slug_of(const std::string& text) {
  std::string slug;
  for (const char c : text) {
    const bool is_word = (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9');
    const bool is_capital = c >= 'A' && c <= 'Z';
    if (is_word || is_capital)
      slug += is_capital ? static_cast<char>(c - 'A' + 'a') : c;
    else if (!slug.empty() && slug.back() != '-')
      slug += '-';
  }
  return slug;
}

Json statement_of(const Assessment& session, const Part& part, const std::string& person,
                  const std::string& home_page) {
  const auto& result = *part.result;
  const auto activity = fmt::format("{}/lessons/{}/{}", home_page, slug_of(session.lesson->title),
                                    slug_of(part.name));
  const std::string verb = result.is_reached ? "passed" : "failed";
  const auto when = session.start_utc_ns + part.end * (1'000'000'000u / kTicksPerSecond);
  return {{"id", uuid_of(fmt::format("{} {} {} {}", session.start_utc_ns, *part.stage, part.begin,
                                     person))},
          {"actor",
           {{"objectType", "Agent"}, {"account", {{"homePage", home_page}, {"name", person}}}}},
          {"verb", {{"id", "http://adlnet.gov/expapi/verbs/" + verb}, {"display", {{"en", verb}}}}},
          {"object",
           {{"objectType", "Activity"},
            {"id", activity},
            {"definition", {{"name", {{"en", session.lesson->title + ": " + part.name}}}}}}},
          {"result",
           {{"score",
             {{"scaled", result.points / 100}, {"raw", result.points}, {"min", 0}, {"max", 100}}},
            {"success", result.is_reached},
            {"completion", true},
            {"duration", fmt::format("PT{:.2f}S", part.seconds())}}},
          {"timestamp", iso_time(when)}};
}

}  // namespace

std::string iso_time(std::uint64_t utc_ns) {
  const auto seconds = static_cast<std::time_t>(utc_ns / 1'000'000'000u);
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(seconds));
}

std::vector<std::string> lines_of(const StrainDamage& strain) {
  std::vector<std::string> lines{fmt::format("{:.2f} ml of tissue were strained beyond {:.0f} %",
                                             strain.volume_m3 * 1e6, strain.limit * 100)};
  for (const auto& part : strain.structures)
    lines.push_back(fmt::format("{:.2f} ml of it within {}", part.volume_m3 * 1e6, part.structure));
  if (strain.greatest > 0)
    lines.push_back(fmt::format("the greatest strain was {:.0f} %, at {:.1f} s",
                                strain.greatest * 100, seconds_of(strain.greatest_tick)));
  if (strain.cut_m2 + strain.torn_m2 > 0)
    lines.push_back(
        fmt::format("{:.2f} cm² of wound were cut, and {:.2f} cm² torn, one side of each",
                    strain.cut_m2 * 1e4, strain.torn_m2 * 1e4));
  return lines;
}

std::string summary_of(const Assessment& session, const std::vector<Standing>& standings) {
  const auto standing_of = [&](const Part& part, Figure figure) -> std::string {
    for (const auto& standing : standings) {
      if (part.stage != standing.stage || standing.tool || standing.key != figure.key) continue;
      figure.value = standing.median;
      return fmt::format("   experts {}, better than {:.0f} % of {}", text_of(figure),
                         standing.percentile, standing.experts);
    }
    return {};
  };
  std::string out;
  const auto line = [&](const std::string& text) { out += text + "\n"; };
  line(fmt::format("{}: {}, {:.1f} s", session.name,
                   session.lesson ? session.lesson->title : "no lesson", session.whole.seconds()));
  if (session.lesson)
    line(fmt::format(
        "{:.0f} of 100 points, {} of {} stages over", session.points,
        session.stages.size() -
            (session.is_over || session.stages.empty() || session.stages.back().result ? 0u : 1u),
        session.lesson->stages.size()));
  const auto show = [&](const Part& part) {
    if (part.result)
      line(fmt::format("\n{}: {}, {:.0f} points", part.name,
                       part.result->is_reached ? "reached" : "not reached", part.result->points));
    else
      line(fmt::format("\n{}{}", part.name, part.stage ? ": not over" : ""));
    if (part.result)
      for (const auto& figure : figures_of(*part.result))
        line(fmt::format("  {:<28} {:>10}{}", figure.words, text_of(figure),
                         standing_of(part, figure)));
    for (const auto& hand : part.hands) {
      line(fmt::format("  {}, tool {}", hand.person, hand.tool.number() + 1));
      for (const auto& figure : figures_of(hand))
        line(fmt::format("    {:<26} {:>10}", figure.words, text_of(figure)));
    }
    for (const auto& moment : part.moments)
      line(fmt::format("  at {:.1f} s {}{}{}", seconds_of(moment.tick), moment.person,
                       moment.person.empty() ? "" : " ", moment.text));
    if (part.moments_left_out > 0) line(fmt::format("  and {} more", part.moments_left_out));
  };
  for (const auto& stage : session.stages) show(stage);
  if (session.stages.empty()) show(session.whole);
  if (session.strain) line("");
  if (session.strain)
    for (const auto& text : lines_of(*session.strain)) line(text);
  for (const auto& note : session.notes) line("note: " + note);
  return out;
}

std::string csv_of(const std::vector<Assessment>& sessions) {
  std::string out = "file,start,lesson,stage,person,tool,measure,value\n";
  for (const auto& session : sessions) {
    const auto title = session.lesson ? session.lesson->title : "";
    const auto add = [&](const std::string& stage, const std::string& person,
                         const std::string& tool, const std::string& key, double value) {
      out += fmt::format("{},{},{},{},{},{},{},{:.9g}\n", recording::csv_text(session.name),
                         iso_time(session.start_utc_ns), recording::csv_text(title),
                         recording::csv_text(stage), recording::csv_text(person), tool, key, value);
    };
    const auto add_part = [&](const Part& part) {
      if (part.result) {
        add(part.name, "", "", "is_reached", part.result->is_reached);
        add(part.name, "", "", "points", part.result->points);
        for (const auto& figure : figures_of(*part.result))
          add(part.name, "", "", figure.key, figure.value);
      }
      for (const auto& hand : part.hands)
        for (const auto& figure : figures_of(hand))
          add(part.name, hand.person, std::to_string(hand.tool.value), figure.key, figure.value);
    };
    for (const auto& stage : session.stages) add_part(stage);
    add_part(session.whole);
    if (session.strain) {
      add(session.whole.name, "", "", "strained_ml", session.strain->volume_m3 * 1e6);
      add(session.whole.name, "", "", "cut_cm2", session.strain->cut_m2 * 1e4);
      add(session.whole.name, "", "", "torn_cm2", session.strain->torn_m2 * 1e4);
      for (const auto& part : session.strain->structures)
        add(session.whole.name, "", "", "strained_ml_" + part.structure, part.volume_m3 * 1e6);
    }
    if (session.lesson) add("", "", "", "points", session.points);
  }
  return out;
}

std::string json_of(const Assessment& session, const std::vector<Standing>& standings) {
  Json json = {{"file", session.name},
               {"start", iso_time(session.start_utc_ns)},
               {"organ", session.organ},
               {"lesson", session.lesson ? Json(session.lesson->title) : Json()},
               {"is_over", session.is_over},
               {"points", session.points}};
  Json stages = Json::array();
  for (const auto& stage : session.stages) stages.push_back(json_of(stage));
  json["stages"] = stages;
  json["whole"] = json_of(session.whole);
  if (session.strain) {
    Json structures = Json::object();
    for (const auto& part : session.strain->structures)
      structures[part.structure] = part.volume_m3 * 1e6;
    json["strain"] = {{"limit", session.strain->limit},
                      {"volume_ml", session.strain->volume_m3 * 1e6},
                      {"structures_ml", structures},
                      {"greatest", session.strain->greatest},
                      {"cut_cm2", session.strain->cut_m2 * 1e4},
                      {"torn_cm2", session.strain->torn_m2 * 1e4},
                      {"greatest_time_s", seconds_of(session.strain->greatest_tick)}};
  }
  Json experts = Json::array();
  for (const auto& standing : standings)
    experts.push_back({{"stage", standing.stage},
                       {"tool", standing.tool ? Json(standing.tool->value) : Json()},
                       {"measure", standing.key},
                       {"median", standing.median},
                       {"percentile", standing.percentile},
                       {"experts", standing.experts}});
  json["experts"] = experts;
  json["notes"] = session.notes;
  return to_text(json);
}

std::string xapi_of(const std::vector<Assessment>& sessions, const std::string& home_page) {
  Json statements = Json::array();
  for (const auto& session : sessions)
    for (const auto& part : session.stages) {
      if (!part.result) continue;
      std::set<std::string> people;
      for (const auto& hand : part.hands)
        if (!hand.person.empty()) people.insert(hand.person);
      for (const auto& person : people)
        statements.push_back(statement_of(session, part, person, home_page));
    }
  return to_text(statements);
}

}  // namespace trocar::assessment
