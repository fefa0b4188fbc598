#include "server/app/journal/assess_command.h"

#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>

#include "common/base/exit_code.h"
#include "common/base/log.h"
#include "common/base/number_option.h"
#include "common/base/text_file.h"
#include "server/app/journal/program_name.h"
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
    std::ifstream in(folder + "/000001.png", std::ios::binary);
    std::string png{std::istreambuf_iterator<char>(in), {}};
    if (png.empty())
      return Error{ErrorCode::ResourceMissing, "--pictures: trocar-client has drawn nothing"};
    pictures.push_back({moment.tick, std::move(png)});
  }
  return pictures;
}

Status write_pdf(const std::string& page, const std::string& pdf) {
  const ScratchFolder scratch;
  const auto html = scratch.path() / "report.html";
  if (auto s = write_text_file(html, page); !s) return s;
  return run_program({"weasyprint", "--quiet", html.string(), pdf},
                     "--pdf needs it (Debian package weasyprint), or print the page of --html");
}

Result<std::vector<std::string>> files_of(const std::string& path) {
  std::error_code error;
  if (!fs::is_directory(path, error)) return std::vector{path};
  std::vector<std::string> files;
  for (fs::directory_iterator it(path, error), end; !error && it != end; it.increment(error))
    if (it->path().extension() == ".mcap") files.push_back(it->path().string());
  if (error)
    return Error{ErrorCode::ResourceMissing, path + ": cannot be read: " + error.message()};
  if (files.empty()) return Error{ErrorCode::ResourceMissing, path + ": has no recording (.mcap)"};
  std::ranges::sort(files);
  return files;
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

// Reads all; says how far it is where people wait.
Result<std::vector<assessment::Assessment>> read_all(const std::vector<std::string>& files,
                                                     const AssessOptions& options) {
  std::vector<assessment::Assessment> sessions;
  for (const auto& file : files) {
    if (files.size() > 1 && ::isatty(STDERR_FILENO) != 0)
      std::fprintf(stderr, "%s: %zu of %zu\n", kProgram, sessions.size() + 1, files.size());
    auto session = assessment::assess(file, {.force_limit_n = options.force_limit_n});
    if (!session) return session.error();
    if (options.measures_strain) {
      auto strain = measure(file, *session, options);
      if (!strain) return strain.error();
      session->strain = std::move(*strain);
    }
    sessions.push_back(std::move(*session));
  }
  // The last recording of a session stands for all of it.
  std::set<std::string> earlier;
  for (const auto& session : sessions)
    for (const auto& part : session.earlier) earlier.insert(part.file);
  std::erase_if(sessions, [&](const auto& session) { return earlier.contains(session.file); });
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
                       session.whole.seconds(), assessment::short_name(session.file));
  return out;
}

}  // namespace

void add_options(CLI::App& command, AssessOptions& options) {
  command.add_option("PATH", options.path, "a recording (.mcap), or a folder: learning curves")
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
  command.add_option("--xapi", options.xapi, "write statements for learning systems (JSON)")
      ->type_name("OUT");
  command
      .add_option("--home-page", options.home_page,
                  "with --xapi: address of the system that knows the people")
      ->type_name("URL")
      ->capture_default_str();
  command
      .add_option("--force-limit", options.force_limit_n,
                  "in N, where a stage has no limit of its own")
      ->check(from_to(0.01, 100))
      ->capture_default_str();
  command.add_flag("--strain", options.measures_strain,
                   "how much tissue was strained too far: simulates the session again");
  command
      .add_option("--strain-limit", options.strain_limit,
                  "with --strain: the greatest principal strain that tissue bears")
      ->check(from_to(0.01, 2))
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
  const auto files = files_of(options.path);
  if (!files) return report(kProgram, files.error());
  auto sessions = read_all(*files, options);
  if (!sessions) return report(kProgram, sessions.error());
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
  return 0;
}

}  // namespace trocar::app
