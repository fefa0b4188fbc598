#include "server/app/journal/assess_command.h"

#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>

#include "common/base/exit_code.h"
#include "common/base/log.h"
#include "common/base/printable.h"
#include "common/base/text_file.h"
#include "common/command_line/limits.h"
#include "server/app/journal/outputs.h"
#include "server/app/journal/program_name.h"
#include "server/app/journal/recordings_of.h"
#include "server/app/journal/run_program.h"
#include "server/session/assessment/assessment.h"
#include "server/session/assessment/report.h"
#include "server/session/assessment/strain.h"
#include "server/session/assessment/tables.h"

namespace trocar::app {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostPictures = 12;
constexpr Tick kApartTicks = 2000;  // two pictures

// A folder for files that are gone when it goes.
class ScratchFolder {
 public:
  ScratchFolder() {
    std::string name = (fs::temp_directory_path() / "trocar-assess-XXXXXX").string();
    if (mkdtemp(name.data()) != nullptr) path_ = name;
  }
  ~ScratchFolder() {
    std::error_code ignored;
    if (!path_.empty()) fs::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

// Empty where there is no such file.
std::string read_file(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

// The pictures are drawn by the client, from the first moments that are some seconds apart.
Result<std::vector<assessment::Picture>> draw_pictures(const assessment::Assessment& session) {
  std::vector<assessment::Picture> pictures;
  const ScratchFolder scratch;
  for (const auto& moment : session.whole.moments) {
    if (pictures.size() == kMostPictures) break;
    if (!pictures.empty() && moment.tick < pictures.back().tick + kApartTicks) continue;
    const auto folder = (scratch.path() / std::to_string(pictures.size())).string();
    const auto at = fmt::format("{:.3f}", static_cast<double>(moment.tick) * 1e-3);
    const auto until = fmt::format("{:.3f}", static_cast<double>(moment.tick) * 1e-3 + 0.001);
    if (auto s = run_program(
            {"trocar-client", "--replay", file_at(session, moment.tick), "--pictures", folder,
             "--from", at, "--to", until, "--size", "960x540", "--log-level", "warn"},
            "--pictures needs the client of this release");
        !s)
      return s.error();
    auto png = read_file(folder + "/000001.png");
    if (png.empty())
      return Error{ErrorCode::ResourceMissing, "--pictures: trocar-client has drawn nothing"};
    pictures.push_back({moment.tick, std::move(png)});
  }
  return pictures;
}

Status write_pdf(const std::string& page, const std::string& pdf) {
  const ScratchFolder scratch;
  const auto html = scratch.path() / "report.html", made = scratch.path() / "report.pdf";
  if (auto s = write_text_file(html, page); !s) return s;
  if (auto s =
          run_program({"weasyprint", "--quiet", html.string(), made.string()},
                      "--pdf needs it (Debian package weasyprint), or print the page of --html");
      !s)
    return s;
  return write_text_file(pdf, read_file(made));
}

Result<assessment::StrainDamage> measure(const std::string& file,
                                         const assessment::Assessment& session,
                                         const AssessOptions& options) {
  const bool is_terminal = ::isatty(STDERR_FILENO) != 0;
  auto strain = assessment::measure_strain(
      file, options.strain_limit, session.lesson ? &*session.lesson : nullptr,
      [&](Tick tick, Tick last) {
        if (is_terminal)
          std::fprintf(stderr, "\r%s: simulated again: %.0f of %.0f s", kProgram,
                       assessment::seconds_of(tick), assessment::seconds_of(last));
      });
  if (is_terminal) std::fprintf(stderr, "\n");
  return strain;
}

Result<assessment::Assessment> read_one(const std::string& file, const AssessOptions& options) {
  auto session = assessment::assess(file, {.force_limit_n = options.force_limit_n});
  if (!session || !options.measures_strain) return session;
  auto strain = measure(file, *session, options);
  if (!strain) return strain.error();
  session->strain = std::move(*strain);
  return session;
}

// Says how far it is where people wait.
void show_count(std::size_t number, std::size_t of) {
  if (of > 1 && ::isatty(STDERR_FILENO) != 0)
    std::fprintf(stderr, "%s: %zu of %zu\n", kProgram, number, of);
}

// The last recording of a session stands for all of it.
void drop_earlier(std::vector<assessment::Assessment>& sessions) {
  std::set<fs::path> earlier;
  for (const auto& session : sessions)
    for (const auto& part : session.earlier) earlier.insert(fs::path(part.file).lexically_normal());
  std::erase_if(sessions, [&](const auto& session) {
    return earlier.contains(fs::path(session.file).lexically_normal());
  });
}

// Reads all that are named.
Result<std::vector<assessment::Assessment>> read_all(const std::vector<std::string>& files,
                                                     const AssessOptions& options) {
  std::vector<assessment::Assessment> sessions;
  for (const auto& file : files) {
    show_count(sessions.size() + 1, files.size());
    auto session = read_one(file, options);
    if (!session) return session.error();
    sessions.push_back(std::move(*session));
  }
  drop_earlier(sessions);
  return sessions;
}

// Reads what is in a folder and those below it. A file that cannot be used is named, with its exit
// code in `code`; the others are measured.
Result<std::vector<assessment::Assessment>> read_folder(const AssessOptions& options, int& code) {
  const fs::path root(options.path);
  const auto files = recordings_of(root);
  if (!files) return files.error();
  std::vector<assessment::Assessment> sessions;
  std::size_t number = 0;
  for (const auto& file : *files) {
    show_count(++number, files->size());
    auto session = read_one(file.string(), options);
    if (!session) {
      code = report(kProgram, session.error());
      continue;
    }
    // Each session of a hall has a folder of its own, and its file the same name as the others'.
    session->name = printable(file.lexically_relative(root).generic_string());
    sessions.push_back(std::move(*session));
  }
  drop_earlier(sessions);
  return sessions;
}

Status write_files(const std::vector<assessment::Assessment>& sessions,
                   const std::vector<assessment::Standing>& standings, bool is_folder,
                   const AssessOptions& options) {
  if (!options.csv.empty())
    if (auto s = write_text_file(options.csv, assessment::csv_of(sessions)); !s) return s;
  if (!options.xapi.empty())
    if (auto s = write_text_file(options.xapi, assessment::xapi_of(sessions, options.home_page));
        !s)
      return s;
  if (options.html.empty() && options.pdf.empty()) return {};
  std::vector<assessment::Picture> pictures;
  if (options.has_pictures && !is_folder) {
    auto drawn = draw_pictures(sessions.front());
    if (!drawn) return drawn.error();
    pictures = std::move(*drawn);
  }
  const auto page = is_folder ? assessment::learning_report_of(sessions)
                              : assessment::report_of(sessions.front(), standings, pictures);
  if (!page) return page.error();
  if (!options.html.empty())
    if (auto s = write_text_file(options.html, *page); !s) return s;
  return options.pdf.empty() ? Status() : write_pdf(*page, options.pdf);
}

std::string overview_of(const std::vector<assessment::Assessment>& sessions) {
  std::string out;
  for (const auto& session : sessions)
    out += fmt::format("{}  {:<24} {:>6.0f} points  {:>7.1f} s  {}\n",
                       assessment::iso_time(session.start_utc_ns),
                       session.lesson ? session.lesson->title : "no lesson", session.points,
                       session.whole.seconds(), session.name);
  return out;
}

}  // namespace

void add_options(CLI::App& command, AssessOptions& options) {
  command
      .add_option("PATH", options.path,
                  "a recording (.mcap), or a folder and those below it: learning curves")
      ->required();
  command
      .add_option("--expert", options.experts,
                  "recordings of the same lesson to compare with, by percentiles")
      ->type_name("FILE");
  command.add_option("--html", options.html, "write the report as a page with plots")
      ->type_name("OUT");
  command.add_option("--pdf", options.pdf, "write the report as PDF, by weasyprint")
      ->type_name("OUT");
  command.add_flag("--pictures", options.has_pictures,
                   "with --html or --pdf: pictures of the moments that cost points, by "
                   "trocar-client");
  command.add_option("--csv", options.csv, "write all numbers as a table, a row each")
      ->type_name("OUT");
  auto* xapi =
      command.add_option("--xapi", options.xapi, "write statements for learning systems (JSON)")
          ->type_name("OUT");
  command
      .add_option("--home-page", options.home_page,
                  "with --xapi: address of the system that knows the people")
      ->type_name("URL")
      ->needs(xapi)
      ->capture_default_str();
  command
      .add_option("--force-limit", options.force_limit_n,
                  "in N, where a stage has no limit of its own")
      ->check(command_line::from_to(0.01, 100))
      ->capture_default_str();
  command.add_flag("--strain", options.measures_strain,
                   "how much tissue was strained too far: simulates the session again");
  command
      .add_option("--strain-limit", options.strain_limit,
                  "with --strain: the greatest principal strain that tissue bears")
      ->check(command_line::from_to(0.01, 2))
      ->capture_default_str();
  command.add_flag("--pseudonyms", options.has_pseudonyms, "write Person 1, 2, ... for names");
  command.add_flag("--json", options.as_json, "print one JSON object");
}

int assess(const AssessOptions& options) {
  std::error_code ignored;
  const bool is_folder = fs::is_directory(options.path, ignored);
  if (is_folder && (options.as_json || !options.experts.empty() || options.has_pictures))
    return report(kProgram, Error{ErrorCode::Usage,
                                  "assess: --json, --expert and --pictures are for one recording, "
                                  "not for a folder"});
  if (options.has_pictures && options.html.empty() && options.pdf.empty())
    return report(kProgram, Error{ErrorCode::Usage,
                                  "assess: --pictures is for a report: name one by --html or "
                                  "--pdf"});
  if (auto s = check_outputs({{"--html", options.html},
                              {"--pdf", options.pdf},
                              {"--csv", options.csv},
                              {"--xapi", options.xapi}});
      !s)
    return report(kProgram, s.error());
  int code = 0;
  auto sessions =
      is_folder ? read_folder(options, code) : read_all(std::vector{options.path}, options);
  if (!sessions) return report(kProgram, sessions.error());
  if (sessions->empty()) return code;
  const auto experts = read_all(options.experts, options);
  if (!experts) return report(kProgram, experts.error());
  std::vector<assessment::Standing> standings;
  if (!experts->empty()) {
    auto compared = assessment::compare(sessions->front(), *experts);
    if (!compared) return report(kProgram, compared.error());
    standings = std::move(*compared);
  }
  if (options.has_pseudonyms) assessment::give_pseudonyms(*sessions);
  if (auto s = write_files(*sessions, standings, is_folder, options); !s)
    return report(kProgram, s.error());
  const auto text = options.as_json ? assessment::json_of(sessions->front(), standings)
                    : is_folder     ? overview_of(*sessions)
                                    : assessment::summary_of(sessions->front(), standings);
  std::fputs(text.c_str(), stdout);
  return code;
}

}  // namespace trocar::app
