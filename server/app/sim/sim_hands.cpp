#include "server/app/sim/sim_hands.h"

#include <cinttypes>
#include <cstdio>
#include <memory>

#include "common/journal/session_journal.h"
#include "server/app/sim/sim_journal.h"
#include "server/lab/scenario/field_files.h"
#include "server/organs/catalogue/load_organ.h"
#include "server/session/recording/recorded_session.h"

namespace trocar::app {
namespace {

struct CloseFile {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, CloseFile>;

void write_tools(const step::PublishedFrame& frame, std::FILE* csv) {
  for (const auto& tool : frame.tools) {
    const auto& p = tool.world_from_tool.position;
    const auto& f = tool.force_n;
    std::fprintf(csv, "%.3f,%u,%s,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%u\n",
                 static_cast<double>(frame.tick) / static_cast<double>(kTicksPerSecond),
                 unsigned{tool.tool.value}, tool::name_of(tool.verb),
                 1e3 * static_cast<double>(p.x), 1e3 * static_cast<double>(p.y),
                 1e3 * static_cast<double>(p.z), static_cast<double>(f.x), static_cast<double>(f.y),
                 static_cast<double>(f.z), tool.contact_nodes);
  }
}

// Drives the ticks of a recording, one after another.
class Replay {
 public:
  Replay(step::Simulation& simulation, SimJournal* journal, std::FILE* csv)
      : simulation_(simulation), journal_(journal), csv_(csv) {}

  Status take(const step::TickRecord& record) {
    if (record.tick != simulation_.current_tick() + 1)
      return Error{ErrorCode::BadFile, "ticks " + std::to_string(simulation_.current_tick() + 1) +
                                           " to " + std::to_string(record.tick - 1) +
                                           " are missing: its hands are not all there"};
    const auto& report = simulation_.tick(record.inputs, record.decisions);
    opened_m2 += report.cut.opened_area_m2;
    rejected += report.solve.nodes_rejected;
    if (publishes_frame(report.tick)) {
      auto frame = std::shared_ptr<step::PublishedFrame>(simulation_.pop_frame());
      write_tools(*frame, csv_);
      if (journal_ != nullptr)
        journal_->add(std::move(frame), record.inputs, record.decisions, report);
    } else if (journal_ != nullptr) {
      journal_->add(nullptr, record.inputs, record.decisions, report);
    }
    if (journal_ != nullptr) journal_->record_due_snapshot(simulation_);
    return {};
  }

  double opened_m2 = 0;
  std::uint64_t rejected = 0;

 private:
  step::Simulation& simulation_;
  SimJournal* const journal_;
  std::FILE* const csv_;
};

}  // namespace

void add_hands_options(CLI::App& app, HandsCommand& command) {
  app.add_option("--hands", command.recording,
                 "instead of a scenario: the hands of this recorded session, on --organ")
      ->type_name("JOURNAL");
  app.add_option("--organ", command.organ,
                 "with --hands: built-in organ, .organ or .msh file [that of the recording]")
      ->type_name("NAME|FILE");
}

Status run_hands(const HandsCommand& command, const std::filesystem::path& folder,
                 const std::string& journal_path, unsigned threads,
                 const volatile std::sig_atomic_t& stop) {
  auto source = journal::SessionJournal::open(command.recording);
  if (!source) return source.error();
  const auto& info = (*source)->info();
  if (info.has_external_loads)
    return Error{ErrorCode::BadFile, command.recording +
                                         ": is of a scenario with loads, which are "
                                         "not recorded: run the scenario itself"};
  auto organ = command.organ.empty() ? recording::recorded_organ(**source, command.recording)
                                     : catalogue::load_organ(command.organ);
  if (!organ) return organ.error();
  step::Simulation simulation(std::move(*organ), threads);
  const auto path = folder / "hands.csv";
  const File csv(std::fopen(path.c_str(), "wb"));
  if (!csv) return Error{ErrorCode::ResourceMissing, path.string() + ": cannot be written"};
  std::fputs("time_s,tool,verb,x_mm,y_mm,z_mm,force_x_n,force_y_n,force_z_n,contact_nodes\n",
             csv.get());
  std::unique_ptr<SimJournal> journal;
  if (!journal_path.empty()) {
    auto created =
        SimJournal::create(journal_path, simulation, recording::recorded_hands(info), false);
    if (!created) return created.error();
    journal = std::move(*created);
  }
  Replay replay(simulation, journal.get(), csv.get());
  const Status read =
      recording::read_ticks(**source, [&](const step::TickRecord& record, bool& is_done) {
        is_done = stop != 0;
        return replay.take(record);
      });
  const Status closed = journal ? journal->close() : Status{};
  if (!read) return Error{read.error().code, command.recording + ": " + read.error().message};
  if (!closed) return closed;
  const auto ticks = simulation.current_tick();
  const double seconds = static_cast<double>(ticks) / static_cast<double>(kTicksPerSecond);
  if (std::ferror(csv.get()) != 0)
    return Error{ErrorCode::ResourceMissing, path.string() + ": cannot be written"};
  if (auto s = scenario::write_field(folder, scenario::field_of(simulation, seconds)); !s) return s;
  std::printf("%s: %" PRIu64 " ticks of its hands on %s, %zu nodes, %.1f cm2 cut, state %016" PRIx64
              "\nresults in %s\n",
              command.recording.c_str(), ticks, simulation.organ().name.c_str(),
              simulation.state().world.node_count(), replay.opened_m2 * 1e4,
              simulation.state_hash(), folder.c_str());
  if (replay.rejected > 0)
    std::fprintf(stderr, "trocar-sim: warning: some nodes had no finite step\n");
  return {};
}

}  // namespace trocar::app
