#include "tests/bench/result_table.h"

#include <cinttypes>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <thread>

#include "common/base/text_file.h"

namespace trocar::bench {
namespace {

using Json = nlohmann::ordered_json;

std::string number(double value, const char* format) {
  char text[40];
  std::snprintf(text, sizeof text, format, value);
  return text;
}
std::string number(const std::optional<double>& value, const char* format) {
  return value ? number(*value, format) : std::string{};
}
// Milliseconds with three significant digits.
std::string milliseconds(double us) {
  const double ms = us * 1e-3;
  return number(ms, ms < 1 ? "%.3f" : ms < 10 ? "%.2f" : "%.1f");
}

Json to_json(const Row& row) {
  Json json{{"name", row.name()},     {"group", row.group},         {"object", row.object},
            {"solver", row.solver},   {"nodes", row.nodes},         {"tets", row.tets},
            {"springs", row.springs}, {"steps", row.steps},         {"threads", row.threads},
            {"dt_ms", row.dt_ms},     {"median_us", row.median_us}, {"p10_us", row.p10_us},
            {"p90_us", row.p90_us}};
  const auto maybe = [&](const char* key, const std::optional<double>& value) {
    if (value) json[key] = *value;
  };
  maybe("wall_us", row.wall_us);
  maybe("wall_p10_us", row.wall_p10_us);
  maybe("all_threads_us", row.all_threads_us);
  maybe("u_mm", row.u_mm);
  maybe("converged_mm", row.converged_mm);
  maybe("error_percent", row.error_percent);
  if (!row.paper_ms.empty()) json["paper_ms"] = row.paper_ms;
  if (!row.peer_ms.empty()) json["peer_ms"] = row.peer_ms;
  if (!row.peer_row.empty()) json["peer_row"] = row.peer_row;
  maybe("target_ms", row.target_ms);
  maybe("error_limit_percent", row.error_limit_percent);
  for (const auto& [key, value] : row.more) json[key] = value;
  json["state_hash"] = row.state_hash;
  if (!row.note.empty()) json["note"] = row.note;
  return json;
}

// A Markdown table; columns as wide as their widest cell, so that a terminal shows it too.
std::string table(const std::vector<std::vector<std::string>>& lines) {
  std::vector<std::size_t> widths(lines.front().size());
  for (const auto& line : lines)
    for (std::size_t c = 0; c < line.size(); ++c) widths[c] = std::max(widths[c], line[c].size());
  std::string out;
  const auto add = [&](const std::vector<std::string>& line) {
    out += '|';
    for (std::size_t c = 0; c < line.size(); ++c) {
      const std::string space(widths[c] - line[c].size(), ' ');
      // Words to the left, figures to the right.
      out += c < 2 ? " " + line[c] + space + " |" : " " + space + line[c] + " |";
    }
    out += '\n';
  };
  add(lines.front());
  std::vector<std::string> rule;
  for (const auto width : widths) rule.push_back(std::string(width, '-'));
  add(rule);
  for (std::size_t i = 1; i < lines.size(); ++i) add(lines[i]);
  return out;
}

std::string wall_words(const Row& row) {
  return row.wall_us ? milliseconds(*row.wall_us) : "";
}

std::string fastest_wall_words(const Row& row) {
  return row.wall_us ? milliseconds(*row.wall_p10_us) : "";
}

// Returns whether the mean error keeps its limit. The largest error of a force may be 5/3 of that.
bool is_accurate(const Row& row) {
  if (!row.error_limit_percent) return true;
  const auto largest = row.more.find("force_error_max_percent");
  return row.error_percent && *row.error_percent <= *row.error_limit_percent &&
         (largest == row.more.end() || largest->second <= *row.error_limit_percent * 5 / 3);
}

std::string largest_error_words(const Row& row) {
  const auto largest = row.more.find("force_error_max_percent");
  return largest == row.more.end() ? "" : number(largest->second, "%.1f");
}

std::string hash_words(const std::string& hash) {
  return hash.substr(0, 8);
}

std::string peers_table(const std::vector<const Row*>& rows) {
  std::vector<std::vector<std::string>> lines{{"mesh", "solver", "dt ms", "CPU ms/step",
                                               "CPU ms/ms", "wall ms", "wall ms, fastest 10 %",
                                               "u(0.1 s) mm", "converged mm", "error %", "hash"}};
  for (const Row* row : rows)
    lines.push_back({row->object, row->solver, number(row->dt_ms, "%g"),
                     milliseconds(row->median_us), milliseconds(row->median_us / row->dt_ms),
                     wall_words(*row), fastest_wall_words(*row), number(row->u_mm, "%.3f"),
                     number(row->converged_mm, "%.3f"), number(row->error_percent, "%.2f"),
                     hash_words(row->state_hash)});
  return table(lines);
}

std::string targets_table(const std::vector<const Row*>& rows, const std::vector<Row>& all) {
  const auto peer_here = [&](const Row& row) -> std::string {
    for (const auto& peer : all)
      if (peer.name() == row.peer_row) return milliseconds(peer.median_us);
    return "";
  };
  std::vector<std::vector<std::string>> lines{
      {"work", "solver", "threads", "paper ms", "best peer ms", "Bullet here ms", "target ms",
       "ours CPU ms", "fastest 10 %", "wall ms", "wall ms, fastest 10 %", "error %",
       "error at most %", "reached", "hash"}};
  for (const Row* row : rows) {
    const double us = row->wall_us.value_or(row->median_us);
    const bool is_right = is_accurate(*row);
    const bool reached = row->target_ms && us * 1e-3 <= *row->target_ms && is_right;
    lines.push_back({row->object, row->solver, std::to_string(row->threads), row->paper_ms,
                     row->peer_ms, peer_here(*row), number(row->target_ms, "%g"),
                     milliseconds(row->median_us), milliseconds(row->p10_us), wall_words(*row),
                     fastest_wall_words(*row), number(row->error_percent, "%.2f"),
                     largest_error_words(*row),
                     reached     ? "yes"
                     : !is_right ? "no: error"
                                 : "no",
                     hash_words(row->state_hash)});
  }
  return table(lines);
}

struct Column {
  const char* title;
  const char* key;  // in the row's JSON
  const char* format;
};

// Writes what the rows' JSON holds under the columns' keys; columns that no row has are left out.
std::string parts_table(const std::vector<const Row*>& rows, std::vector<Column> columns) {
  std::vector<Json> objects;
  for (const Row* row : rows) objects.push_back(to_json(*row));
  std::erase_if(columns, [&](const Column& column) {
    return std::none_of(objects.begin(), objects.end(),
                        [&](const Json& json) { return json.contains(column.key); });
  });
  std::vector<std::vector<std::string>> lines{{"object", "solver"}};
  for (const auto& column : columns) lines[0].push_back(column.title);
  lines[0].push_back("hash");
  for (std::size_t i = 0; i < rows.size(); ++i) {
    lines.push_back({rows[i]->object, rows[i]->solver});
    for (const auto& column : columns)
      lines.back().push_back(objects[i].contains(column.key)
                                 ? number(objects[i][column.key].get<double>(), column.format)
                                 : "");
    lines.back().push_back(hash_words(rows[i]->state_hash));
  }
  return table(lines);
}

std::string growth_table(const std::vector<const Row*>& rows) {
  return parts_table(rows, {{"nodes", "nodes", "%.0f"},
                            {"tets", "tets", "%.0f"},
                            {"swept fully", "active_nodes", "%.0f"},
                            {"CPU us/step", "median_us", "%.1f"},
                            {"contacts us", "init_us", "%.1f"},
                            {"queue us", "queue_us", "%.1f"},
                            {"solve us", "solve_us", "%.1f"},
                            {"rest us", "rest_us", "%.1f"},
                            {"force mN", "force_mean_mn", "%.0f"},
                            {"full solve's", "full_force_mean_mn", "%.0f"},
                            {"error %", "error_percent", "%.2f"},
                            {"at most", "force_error_max_percent", "%.1f"},
                            {"field error %", "field_error_percent", "%.2f"}});
}

std::string graded_table(const std::vector<const Row*>& rows) {
  return parts_table(rows, {{"nodes", "nodes", "%.0f"},
                            {"near", "active_nodes", "%.0f"},
                            {"CPU us/tick", "median_us", "%.0f"},
                            {"contacts us", "init_us", "%.1f"},
                            {"queue us", "queue_us", "%.1f"},
                            {"near us", "near_us", "%.0f"},
                            {"far us", "far_us", "%.0f"},
                            {"far sweeps", "far_sweeps", "%.0f"},
                            {"far ns/node", "far_ns_per_node", "%.0f"},
                            {"rest us", "rest_us", "%.0f"},
                            {"state bytes", "state_bytes", "%.0f"}});
}

std::string queue_table(const std::vector<const Row*>& rows) {
  return parts_table(rows, {{"swept fully", "active_nodes", "%.0f"},
                            {"init us", "init_us", "%.1f"},
                            {"queue us", "queue_us", "%.1f"},
                            {"solve us", "solve_us", "%.1f"},
                            {"all three us", "median_us", "%.1f"}});
}

std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string out = "\"";
  for (const char c : text) out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + "\"";
}

std::string csv(const std::vector<Row>& rows) {
  // The union of all keys, in the order in which they first occur.
  std::vector<std::string> keys;
  std::vector<Json> objects;
  for (const auto& row : rows) {
    objects.push_back(to_json(row));
    for (const auto& [key, value] : objects.back().items())
      if (std::find(keys.begin(), keys.end(), key) == keys.end()) keys.push_back(key);
  }
  std::string out;
  for (const auto& key : keys) out += (out.empty() ? "" : ",") + csv_field(key);
  out += '\n';
  for (const auto& object : objects) {
    std::string line;
    for (const auto& key : keys) {
      if (&key != &keys.front()) line += ',';
      if (!object.contains(key)) continue;
      const auto& value = object[key];
      line += csv_field(value.is_string() ? value.get<std::string>() : value.dump());
    }
    out += line + '\n';
  }
  return out;
}

// gnuplot's own form: one block per solver, two empty lines between blocks, the solver's name
// first.
std::string blocks(const std::vector<const Row*>& rows, const std::vector<std::string>& columns) {
  std::vector<std::string> solvers;
  for (const Row* row : rows)
    if (std::find(solvers.begin(), solvers.end(), row->solver) == solvers.end())
      solvers.push_back(row->solver);
  std::ostringstream out;
  for (const auto& solver : solvers) {
    out << '"' << solver << "\"\n";
    for (const Row* row : rows) {
      if (row->solver != solver) continue;
      const Json json = to_json(*row);
      out << '"' << row->object << '"';
      for (const auto& column : columns)
        out << ' ' << (json.contains(column) ? json[column].dump() : "NaN");
      out << '\n';
    }
    out << "\n\n";
  }
  return out.str();
}

}  // namespace

std::string hex(std::uint64_t hash) {
  char text[17];
  std::snprintf(text, sizeof text, "%016" PRIx64, hash);
  return text;
}

double load_average() {
  double load = 0;
  return getloadavg(&load, 1) == 1 ? load : 0;
}

bool Machine::is_busy() const {
  // One core's worth is ours while this runs.
  return load_before > 0.5 || load_after > 1.5;
}

Machine this_machine() {
  Machine machine;
  machine.cores = std::thread::hardware_concurrency();
  machine.compiler =
#ifdef __clang__
      "clang " __clang_version__;
#else
      "g++ " __VERSION__;
#endif
  machine.isa = TROCAR_BENCH_ISA;
  machine.build_type = TROCAR_BENCH_BUILD_TYPE;
  machine.load_before = machine.load_after = load_average();
  std::ifstream cpuinfo("/proc/cpuinfo");
  for (std::string line; machine.processor.empty() && std::getline(cpuinfo, line);)
    if (line.starts_with("model name")) machine.processor = line.substr(line.find(':') + 2);
  return machine;
}

std::string ResultTable::markdown(const Machine& machine) const {
  std::string out = "# Benchmarks\n\nMachine: " + machine.processor + ", " +
                    std::to_string(machine.cores) + " cores; " + machine.compiler + ", " +
                    machine.isa + ", " + machine.build_type + "; commit " + machine.commit +
                    "; peer: " + machine.peer_version + ".\nLoad average " +
                    number(machine.load_before, "%.2f") + " before, " +
                    number(machine.load_after, "%.2f") + " after.";
  if (machine.is_busy())
    out +=
        " THE MACHINE WAS BUSY with other work: CPU times hold to within some 20 %, wall times do "
        "not count.";
  out +=
      "\nTimes: medians of the CPU time of one thread per step, unless a column says otherwise. "
      "Errors: of the displacement at 0.1 s, or of the force on the tools (mean, in parts of its "
      "peak), against the same mesh and law solved to convergence.\n";
  const std::pair<const char*, const char*> groups[] = {
      {"peers", "The same box, load and material, solved by others and by us"},
      {"targets", "Targets"},
      {"nodes", "Growth with the organ's nodes"},
      {"graded", "Growth of a graded tick with the organ's nodes: one contact, the same queue"},
      {"contacts", "Growth with contacts, in a liver"},
      {"queue",
       "A tick's parts against propagation depth, lattice of 30 x 15 x 30 (Choi 2002, "
       "fig. 6)"}};
  for (const auto& [group, title] : groups) {
    std::vector<const Row*> rows;
    for (const auto& row : rows_)
      if (row.group == group) rows.push_back(&row);
    if (rows.empty()) continue;
    out += "\n## " + std::string(title) + "\n\n";
    out += group == std::string_view("peers")     ? peers_table(rows)
           : group == std::string_view("targets") ? targets_table(rows, rows_)
           : group == std::string_view("queue")   ? queue_table(rows)
           : group == std::string_view("graded")  ? graded_table(rows)
                                                  : growth_table(rows);
    std::set<std::string> notes;
    for (const Row* row : rows)
      if (!row->note.empty()) notes.insert(row->object + ", " + row->solver + ": " + row->note);
    if (!notes.empty()) out += '\n';
    for (const auto& note : notes) out += "- " + note + "\n";
  }
  return out;
}

Status ResultTable::write(const std::filesystem::path& folder, const Machine& machine) const {
  Json json{{"machine",
             {{"processor", machine.processor},
              {"cores", machine.cores},
              {"compiler", machine.compiler},
              {"isa", machine.isa},
              {"build_type", machine.build_type},
              {"commit", machine.commit},
              {"peer", machine.peer_version},
              {"load_before", machine.load_before},
              {"load_after", machine.load_after},
              {"is_busy", machine.is_busy()}}},
            {"rows", Json::array()}};
  for (const auto& row : rows_) json["rows"].push_back(to_json(row));

  const auto select = [&](const char* group) {
    std::vector<const Row*> rows;
    for (const auto& row : rows_)
      // The figures of several threads are wall times: another axis.
      if (row.group == group && row.threads == 1) rows.push_back(&row);
    return rows;
  };
  std::error_code error;
  const auto plots = folder / "plots";
  std::filesystem::create_directories(plots, error);
  const std::pair<std::filesystem::path, std::string> files[] = {
      {folder / "bench.json", json.dump(1) + "\n"},
      {folder / "bench.csv", csv(rows_)},
      {folder / "bench.md", markdown(machine)},
      {plots / "peers.dat", blocks(select("peers"), {"nodes", "median_us", "dt_ms", "u_mm"})},
      {plots / "nodes.dat", blocks(select("nodes"), {"nodes", "tets", "median_us"})},
      {plots / "graded.dat",
       blocks(select("graded"), {"nodes", "near_us", "far_us", "rest_us", "median_us"})},
      {plots / "contacts.dat",
       blocks(select("contacts"), {"contacts", "active_nodes", "median_us"})},
      {plots / "queue.dat", blocks(select("queue"), {"active_nodes", "init_us", "queue_us",
                                                     "solve_us", "median_us", "depth"})},
  };
  for (const auto& [path, text] : files)
    if (auto status = write_text_file(path, text); !status) return status;
  return {};
}

}  // namespace trocar::bench
