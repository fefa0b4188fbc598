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
  // lists: of hands, in order.
  Replay(step::Simulation& simulation, std::vector<recording::PresentHands> lists,
         SimJournal* journal, std::FILE* csv)
      : simulation_(simulation), lists_(std::move(lists)), journal_(journal), csv_(csv) {}

  Status take(const step::TickRecord& record) {
    if (record.tick != simulation_.current_tick() + 1)
      return Error{ErrorCode::BadFile, "ticks " + std::to_string(simulation_.current_tick() + 1) +
                                           " to " + std::to_string(record.tick - 1) +
                                           " are missing: its hands are not all there"};
    for (; journal_ != nullptr && next_list_ < lists_.size() &&
           lists_[next_list_].tick <= record.tick;
         ++next_list_)
      journal_->record_hands(lists_[next_list_].hands, lists_[next_list_].tick);
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
  const std::vector<recording::PresentHands> lists_;
  std::size_t next_list_ = 0;
  SimJournal* const journal_;
  std::FILE* const csv_;
};

void warn(const std::string& recording, const char* what) {
  std::fprintf(stderr, "trocar-sim: warning: %s: %s\n", recording.c_str(), what);
}

Status restore_start(journal::SessionJournal& source, const std::string& path,
                     step::Simulation& simulation) {
  const auto start = source.snapshot_before(0);
  if (!start) return start.error();
  if (!*start) return Error{ErrorCode::BadFile, path + ": the snapshot of its start is missing"};
  const auto state = bytes_of(std::string_view((*start)->state()));
  const auto restored = simulation.restore_snapshot(state);
  return restored ? restored : Error{restored.error().code, path + ": " + restored.error().message};
}

// Its state is of this organ and these loads.
bool has_recorded_start(const HandsCommand& command, const journal::SessionInfo& info) {
  return info.starts_from_snapshot && command.organ.empty();
}

// The organ that the hands work on, with the recording's loads, at the start.
Result<step::Simulation> simulation_of(const HandsCommand& command, journal::SessionJournal& source,
                                       unsigned threads) {
  const auto& path = command.recording;
  const auto& info = source.info();
  auto organ = recording::recorded_organ(source, path);
  if (!organ) return organ.error();
  auto loads = recording::recorded_loads(source, *organ, path);
  if (!loads) return loads.error();
  if (info.has_external_loads && loads->empty())
    return Error{ErrorCode::BadFile, path +
                                         ": is of a scenario with loads, which it does not hold: "
                                         "run the scenario itself"};
  if (!command.organ.empty()) {
    auto other = catalogue::load_organ(command.organ);
    if (!other) return other.error();
    const bool has_loads = !loads->empty();
    if (has_loads && other->mesh.rest_positions != organ->mesh.rest_positions) {
      *loads = {};
      warn(path, "its loads are of the nodes of its own organ, and are left out");
    } else if (has_loads && !step::validate(*loads, *other)) {
      return Error{ErrorCode::Usage,
                   "--organ: " + command.organ + " holds nodes that the recording displaces"};
    }
    *organ = std::move(*other);
  }
  step::Simulation simulation(std::move(*organ), threads, {.loads = std::move(*loads)});
  if (has_recorded_start(command, info)) {
    if (auto s = restore_start(source, path, simulation); !s) return s.error();
  } else if (info.starts_from_snapshot) {
    warn(path, "its equilibrium at the start is of another organ: this one starts at rest");
  }
  return simulation;
}

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
  auto made = simulation_of(command, **source, threads);
  if (!made) return made.error();
  auto& simulation = *made;
  const auto path = folder / "hands.csv";
  const File csv(std::fopen(path.c_str(), "wb"));
  if (!csv) return Error{ErrorCode::ResourceMissing, path.string() + ": cannot be written"};
  std::fputs("time_s,tool,verb,x_mm,y_mm,z_mm,force_x_n,force_y_n,force_z_n,contact_nodes\n",
             csv.get());
  std::unique_ptr<SimJournal> journal;
  if (!journal_path.empty()) {
    recording::Beginning beginning;
    beginning.starts_from_snapshot = has_recorded_start(command, info);
    auto created = SimJournal::create(journal_path, simulation, std::move(beginning));
    if (!created) return created.error();
    journal = std::move(*created);
  }
  auto lists = recording::recorded_hands(**source);
  if (!lists) return lists.error();
  Replay replay(simulation, std::move(*lists), journal.get(), csv.get());
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
