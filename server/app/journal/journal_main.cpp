// trocar-journal: what a recorded session holds, and whether it simulates to the same bits again.

#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>

#include <cinttypes>
#include <cstdio>

#include "common/base/json.h"
#include "common/base/log.h"
#include "common/base/program.h"
#include "common/base/stdout_check.h"
#include "common/base/timing.h"
#include "common/base/unfinished_file.h"
#include "common/base/version.h"
#include "common/command_line/command_line.h"
#include "common/journal/mcap_repair.h"
#include "common/journal/recording_end.h"
#include "common/journal/session_journal.h"
#include "common/wire/role.h"
#include "server/app/journal/assess_command.h"
#include "server/app/journal/copy_commands.h"
#include "server/app/journal/outputs.h"
#include "server/app/journal/program_name.h"
#include "server/app/journal/push_command.h"
#include "server/session/recording/anonymise.h"
#include "server/session/recording/force_table.h"
#include "server/session/recording/lesson_table.h"
#include "server/session/recording/verify.h"

namespace trocar::app {
namespace {

std::uint64_t count_of(const journal::McapReader& mcap, std::uint16_t id) {
  const auto& counts = mcap.statistics().channel_message_counts;
  const auto count = counts.find(id);
  return count == counts.end() ? 0 : count->second;
}

double seconds_of(const journal::SessionInfo& info) {
  return static_cast<double>(info.last_tick - info.begin_tick()) /
         static_cast<double>(kTicksPerSecond);
}

Json json_of(const journal::SessionInfo& info, const journal::McapReader& mcap) {
  Json channels = Json::object();
  for (const auto& [id, channel] : mcap.channels()) channels[channel.topic] = count_of(mcap, id);
  Json continues;
  if (info.continues) continues = {{"file", info.continues->file}, {"tick", info.continues->tick}};
  Json trimmed;
  if (info.trimmed) trimmed = {{"file", info.trimmed->file}, {"tick", info.trimmed->tick}};
  return {{"seconds", seconds_of(info)},
          {"last_tick", info.last_tick},
          {"continues", continues},
          {"trimmed", trimmed},
          {"joins", info.joins},
          {"sim_version", info.sim_version},
          {"protocol", info.protocol},
          {"organ", info.organ_name},
          {"finished", info.is_finished},
          {"gap_messages", info.gap_messages},
          {"external_loads", info.has_external_loads},
          {"starts_from_snapshot", info.starts_from_snapshot},
          {"channels", channels}};
}

int show_info(const std::string& path, bool as_json) {
  auto journal = journal::SessionJournal::open(path);
  if (!journal) return report(kProgram, journal.error());
  const auto& info = (*journal)->info();
  const auto& mcap = (*journal)->container();
  if (as_json) {
    std::fputs(to_text(json_of(info, mcap)).c_str(), stdout);
    return 0;
  }
  std::printf("%s\n", path.c_str());
  std::printf("  %s\n", info.summary.c_str());
  std::printf("  organ        %s (hash %016" PRIx64 ")\n", info.organ_name.c_str(),
              info.organ_hash);
  std::printf("  length       %.1f s, %" PRIu64 " ticks\n", seconds_of(info),
              info.last_tick - info.begin_tick());
  if (info.continues)
    std::printf("  continues    %s, after tick %" PRIu64 "\n", info.continues->file.c_str(),
                info.continues->tick);
  if (info.trimmed)
    std::printf("  trimmed      out of %s, after tick %" PRIu64 "\n", info.trimmed->file.c_str(),
                info.trimmed->tick);
  for (const auto tick : info.joins)
    std::printf("  join         another server went on after tick %" PRIu64 "\n", tick);
  if (info.has_external_loads) std::printf("  loads        of a scenario, besides its tools\n");
  if (info.starts_from_snapshot)
    std::printf("  start        the first snapshot, not the organ at rest\n");
  std::printf("  sim_version  %u%s, protocol %s\n", info.sim_version,
              info.sim_version == kSimVersion ? "" : " (this program has another)",
              info.protocol.c_str());
  std::printf("  participants %zu\n", info.participants.size());
  for (const auto& participant : info.participants)
    std::printf("    %-24s %s\n", participant.name().c_str(),
                wire::name_of(wire::role_of(participant.role())));
  std::printf("  channels\n");
  for (const auto& [id, channel] : mcap.channels())
    std::printf("    %-24s %8" PRIu64 " messages\n", channel.topic.c_str(), count_of(mcap, id));
  if (info.gap_messages > 0)
    std::printf("  gaps         %" PRIu64 " frames were dropped while recording\n",
                info.gap_messages);
  return 0;
}

Json json_of(const recording::VerifyReport& r) {
  Json difference;
  if (const auto& first = r.first_difference)
    difference = {{"tick", first->tick},
                  {"channel", first->channel},
                  {"field", first->field},
                  {"recorded", first->recorded},
                  {"simulated", first->simulated}};
  return {{"verified", r.verdict() == recording::Verdict::Verified},
          {"verdict", recording::name_of(r.verdict())},
          {"reasons", r.reasons},
          {"reasons_left_out", r.reasons_left_out},
          {"first_difference", difference},
          {"resimulated", r.is_resimulated},
          {"begin_tick", r.begin_tick},
          {"first_tick", r.first_tick},
          {"last_tick", r.last_tick},
          {"ticks_verified", r.ticks_verified},
          {"ticks_missing", r.ticks_missing},
          {"ticks_not_simulated", r.ticks_not_simulated},
          {"frames_verified", r.frames_verified},
          {"surfaces_verified", r.surfaces_verified},
          {"bled_surfaces", r.bled_surfaces},
          {"surfaces_decoded", r.surfaces_decoded},
          {"snapshots_verified", r.snapshots_verified},
          {"snapshots_continued", r.snapshots_continued},
          {"participants_verified", r.participants_verified},
          {"damaged_chunks", r.damaged_chunks},
          {"joins", r.joins},
          {"last_hash", hex64(r.last_hash)},
          {"container", r.container}};
}

std::string text_of(const std::string& path, const recording::VerifyReport& r) {
  std::string out = fmt::format(
      "{}: {}\n"
      "{} of {} ticks simulated again with equal hashes, {} missing; equal: {} frames with tools "
      "and "
      "claims, {} surfaces ({} decoded), {} snapshots ({} restored and continued), participants in "
      "{} frames\n",
      path, r.container, r.ticks_verified, r.last_tick - r.begin_tick, r.ticks_missing,
      r.frames_verified, r.surfaces_verified, r.surfaces_decoded, r.snapshots_verified,
      r.snapshots_continued, r.participants_verified);
  if (r.bled_surfaces > 0) out += fmt::format("{} of these surfaces with blood\n", r.bled_surfaces);
  for (const auto tick : r.joins)
    out += fmt::format("another server went on after tick {}, from that state\n", tick);
  out += r.why();
  if (r.verdict() == recording::Verdict::Verified)
    out += fmt::format("verified to tick {}, hash {:016x}\n", r.last_tick, r.last_hash);
  return out;
}

// Says whether all of a recording is as the owner of that key signed it.
Status check_owner(const std::string& path, const std::string& key_file) {
  const auto key = secure::read_public_key(key_file);
  if (!key) return key.error();
  auto reader = journal::McapReader::open(path);
  if (!reader) return reader.error();
  return journal::check_signature(**reader, *key, key_file);
}

int verify(const std::string& path, const std::string& key_file, bool as_json) {
  if (!key_file.empty())
    if (auto fine = check_owner(path, key_file); !fine) return report(kProgram, fine.error());
  const std::uint64_t started = monotonic_ns();
  const bool is_terminal = ::isatty(STDERR_FILENO) != 0;
  bool is_progress_shown = false;
  auto verified = recording::verify_journal(path, [&](Tick tick, Tick last) {
    if (!is_terminal || as_json || monotonic_ns() - started < 2'000'000'000u) return;
    is_progress_shown = true;
    std::fprintf(stderr, "\r%s: %" PRIu64 " of %" PRIu64 " s", kProgram, tick / kTicksPerSecond,
                 last / kTicksPerSecond);
  });
  if (is_progress_shown) std::fprintf(stderr, "\n");
  if (!verified) return report(kProgram, verified.error());
  if (as_json) {
    auto json = json_of(*verified);
    json["signed_with"] = key_file.empty() ? Json() : Json(key_file);
    std::fputs(to_text(json).c_str(), stdout);
  } else {
    std::fputs(text_of(path, *verified).c_str(), stdout);
    if (!key_file.empty()) std::printf("signed with the key of %s\n", key_file.c_str());
  }
  switch (verified->verdict()) {
    case recording::Verdict::Verified:
      return static_cast<int>(ExitCode::Ok);
    case recording::Verdict::Different:
      return static_cast<int>(ExitCode::Mismatch);
    case recording::Verdict::NotVerified:
      return static_cast<int>(ExitCode::NotVerified);
  }
  return static_cast<int>(ExitCode::NotVerified);
}

int repair(const std::string& path, const std::string& to) {
  const auto repaired = journal::repair(path, to);
  if (!repaired) return report(kProgram, repaired.error());
  std::printf("%s: %" PRIu64 " messages; lost: %" PRIu64 " bytes at the end, %" PRIu64
              " damaged chunks\n",
              to.c_str(), repaired->messages, repaired->dropped_bytes, repaired->damaged_chunks);
  return 0;
}

int take_names_out(const std::string& path, const std::string& to, bool keeps_words) {
  const auto report_of = recording::anonymise(path, to, keeps_words);
  if (!report_of) return report(kProgram, report_of.error());
  std::printf("%s: %zu people have pseudonyms; %" PRIu64
              " lines of talk, notes and reasons are %s\n",
              to.c_str(), report_of->people, report_of->words,
              keeps_words ? "kept: read them before you give this away" : "taken out");
  std::printf("Motions and the date stay, and may tell who it was.\n");
  return 0;
}

int export_forces(const std::string& path, const std::string& table) {
  const auto counts = recording::write_force_table(path, table);
  if (!counts) return report(kProgram, counts.error());
  std::printf("%s: %" PRIu64 " rows, %" PRIu64 " of them felt by a hand\n", table.c_str(),
              counts->rows, counts->felt);
  if (counts->left_out > 0)
    std::printf("the recording had no room for %" PRIu64 " reports of hands\n", counts->left_out);
  if (counts->refused > 0)
    std::printf("%" PRIu64 " reports of hands are out of their ranges: left out\n",
                counts->refused);
  return 0;
}

int export_lesson(const std::string& path, const std::string& table) {
  const auto counts = recording::write_lesson_table(path, table);
  if (!counts) return report(kProgram, counts.error());
  std::printf("%s: %" PRIu64 " rows\n", table.c_str(), counts->rows);
  if (counts->left_out > 0)
    std::printf("the recording had no room for %" PRIu64 " of them\n", counts->left_out);
  return 0;
}

int run(int argc, char** argv) {
  CLI::App app{"Looks into recorded Trocar sessions (.mcap).", kProgram};
  app.footer(
      "Examples:\n"
      "  trocar-journal info out/demo/session.mcap     who, how long, which channels\n"
      "  trocar-journal verify out/demo/session.mcap   simulate again, name the first difference\n"
      "  trocar-journal export session.mcap --forces forces.csv\n"
      "                                                forces of tools and hands as a table\n"
      "  trocar-journal export session.mcap --lesson lesson.csv\n"
      "                                                what instructors did, notes, talk, "
      "pointing\n"
      "  trocar-journal assess session.mcap --html report.html\n"
      "                                                measure what people did, stage by stage\n"
      "  trocar-journal assess out/ --html curves.html learning curves over a folder of sessions\n"
      "  trocar-journal push recordings s3://lessons/2026 --endpoint https://s3.example\n"
      "                                                bring a folder to S3-compatible storage\n"
      "  trocar-journal repair killed.mcap whole.mcap  for other programs that read MCAP\n"
      "  trocar-journal merge session.mcap session-2.mcap whole.mcap\n"
      "                                                one file of a session whose server was "
      "killed\n"
      "  trocar-journal trim session.mcap part.mcap --from 60 --to 90\n"
      "                                                half a minute of it, which verifies\n"
      "  trocar-journal anonymise session.mcap shared.mcap\n"
      "                                                a copy without names, which verifies\n"
      "  trocar-journal sign session.mcap signed.mcap --key key.pem\n"
      "                                                a copy that shows whose it is\n"
      "  trocar-journal verify signed.mcap --check key.pub\n"
      "                                                is it theirs, and as they signed it?\n"
      "Exit codes: 0 done or verified, 1 difference found or not signed so, 2 usage, 3 file cannot "
      "be read or is\n"
      "not overwritten, 4 storage refuses, 5 something is missing or cannot be written, 6 not all\n"
      "could be verified, though nothing differs: the reasons are printed. A signal such as\n"
      "SIGTERM ends it without one, and leaves no half of a file.");
  app.require_subcommand(1);
  std::string log_level = "warn", path, repaired_path;
  bool as_json = false;
  app.set_version_flag("--version", std::string(kProgram) + " " + kVersion + ", sim_version " +
                                        std::to_string(kSimVersion) + ", protocol " +
                                        std::to_string(kProtocolMajor) + "." +
                                        std::to_string(kProtocolMinor));
  app.add_option("--log-level", log_level, "error, warn, info, debug or off")
      ->capture_default_str();
  auto* info = app.add_subcommand("info", "Show what the journal holds");
  auto* check =
      app.add_subcommand("verify", "Simulate the session again and compare all that it says");
  auto* mend = app.add_subcommand(
      "repair", "Write a recording that was cut short or is damaged again, as a whole file");
  auto* hide = app.add_subcommand(
      "anonymise",
      "Write a recording again with pseudonyms for names, and without what people typed");
  bool keeps_words = false;
  hide->add_option("FILE", path, "the journal (.mcap)")->required();
  hide->add_option("NEW", repaired_path, "the file to write, which must not exist")->required();
  hide->add_flag("--keep-words", keeps_words,
                 "keep talk, notes and reasons, but for names in them");
  AssessOptions assess_options;
  auto* measure = app.add_subcommand("assess", "Measure what people did, and report it");
  add_options(*measure, assess_options);
  std::string force_table, lesson_table;
  auto* give = app.add_subcommand("export", "Write what a recording holds as a table");
  give->add_option("FILE", path, "a journal (.mcap)")->required();
  give->add_option("--forces", force_table,
                   "a row for each tool and frame: position, force of the tissue, and what a hand "
                   "felt (CSV)")
      ->type_name("OUT");
  give->add_option("--lesson", lesson_table,
                   "a row for each thing that an instructor did, or that somebody said or showed "
                   "(CSV)")
      ->type_name("OUT");
  mend->add_option("FILE", path, "the journal (.mcap)")->required();
  mend->add_option("NEW", repaired_path, "the file to write, which must not exist")->required();
  for (auto* command : {info, check}) {
    command->add_option("FILE", path, "a journal (.mcap)")->required();
    command->add_flag("--json", as_json, "print one JSON object");
  }
  MergeOptions merge_options;
  auto* join = app.add_subcommand(
      "merge",
      "Put the recordings of one session together that servers have left that were killed");
  add_options(*join, merge_options);
  TrimCommand trim_command;
  auto* cut = app.add_subcommand("trim", "Cut a shorter recording out of one");
  add_options(*cut, trim_command);
  PushCommand push_command;
  auto* bring = app.add_subcommand("push", "Bring recordings to S3-compatible storage");
  add_options(*bring, push_command);
  SignCommand sign_command;
  auto* seal = app.add_subcommand("sign", "Write a recording again with a signature");
  add_options(*seal, sign_command);
  std::string owner_file;
  check
      ->add_option("--check", owner_file,
                   "public Ed25519 key (PEM): before all else, whether its owner signed the "
                   "recording as it is")
      ->type_name("KEY");
  const auto parsed = command_line::parse_command_line(app, argc, argv);
  if (!parsed) return report(kProgram, parsed.error());
  if (!*parsed) return static_cast<int>(ExitCode::Ok);
  if (auto s = log::configure(kProgram, log_level); !s) return report(kProgram, s.error());
  if (measure->parsed()) return assess(assess_options);
  if (cut->parsed()) return trim_recording(trim_command);
  if (seal->parsed()) return sign_recording(sign_command);
  if (bring->parsed()) return push(push_command);
  if (join->parsed()) return merge_parts(merge_options);
  if (mend->parsed()) return repair(path, repaired_path);
  if (hide->parsed()) return take_names_out(path, repaired_path, keeps_words);
  if (give->parsed()) {
    if (force_table.empty() && lesson_table.empty())
      return report(kProgram, Error{ErrorCode::Usage,
                                    "export: say what, with --forces OUT or "
                                    "--lesson OUT"});
    if (auto s = check_outputs({{"--forces", force_table}, {"--lesson", lesson_table}}); !s)
      return report(kProgram, s.error());
    const int forces = force_table.empty() ? 0 : export_forces(path, force_table);
    return forces != 0 || lesson_table.empty() ? forces : export_lesson(path, lesson_table);
  }
  return check->parsed() ? verify(path, owner_file, as_json) : show_info(path, as_json);
}

}  // namespace
}  // namespace trocar::app

int main(int argc, char** argv) {
  trocar::begin_program(trocar::app::kProgram);
  trocar::remove_unfinished_files_on_signals();
  return trocar::finish_output(trocar::app::kProgram, trocar::app::run(argc, argv));
}
