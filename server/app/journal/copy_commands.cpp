#include "server/app/journal/copy_commands.h"

#include <CLI/CLI.hpp>

#include <cinttypes>
#include <cmath>
#include <cstdio>

#include "common/base/result.h"
#include "common/base/tick.h"
#include "common/command_line/limits.h"
#include "common/secure/signing.h"
#include "server/app/journal/program_name.h"
#include "server/session/recording/merge.h"
#include "server/session/recording/sign.h"
#include "server/session/recording/trim.h"

namespace trocar::app {
namespace {

constexpr double kMostSeconds = 1e6;  // more than eleven days

double seconds_of(Tick tick) {
  return static_cast<double>(tick) / static_cast<double>(kTicksPerSecond);
}

Tick ticks_of(double seconds) {
  return static_cast<Tick>(std::llround(seconds * static_cast<double>(kTicksPerSecond)));
}

}  // namespace

void add_options(CLI::App& command, MergeOptions& options) {
  command
      .add_option("PART... NEW", options.files,
                  "all recordings of the session, and the file to write, which must not exist")
      ->required()
      ->type_name("");
}

int merge_parts(const MergeOptions& options) {
  if (options.files.size() < 3)
    return report(kProgram,
                  Error{ErrorCode::Usage, "merge: name two parts or more, and the file to write"});
  auto parts = options.files;
  const auto to = parts.back();
  parts.pop_back();
  const auto merged = recording::merge(parts, to);
  if (!merged) return report(kProgram, merged.error());
  std::printf("%s: %" PRIu64 " messages of %zu recordings, %.1f s\n", to.c_str(), merged->messages,
              merged->parts.size(), seconds_of(merged->last_tick));
  for (std::size_t i = 0; i < merged->joins.size(); ++i)
    std::printf("  %s goes on after %.3f s\n", merged->parts[i + 1].c_str(),
                seconds_of(merged->joins[i]));
  if (merged->torn_frames > 0)
    std::printf("Of %" PRIu64
                " frames the killed server has not written all: verify names what is missing.\n",
                merged->torn_frames);
  if (!merged->has_end)
    std::printf("The last part was cut short: the end of the session is missing.\n");
  return 0;
}

void add_options(CLI::App& command, TrimCommand& options) {
  command.add_option("FILE", options.file, "the journal (.mcap)")->required();
  command.add_option("NEW", options.to, "the file to write, which must not exist")->required();
  command
      .add_option("--from", options.from_s, "in s of the session; begins at the keyframe before")
      ->check(command_line::from_to(0, kMostSeconds))
      ->capture_default_str();
  command.add_option("--to", options.to_s, "in s of the session; the end without it")
      ->check(command_line::from_to(0, kMostSeconds));
}

int trim_recording(const TrimCommand& options) {
  recording::TrimOptions asked{.from = ticks_of(options.from_s),
                               .to = ticks_of(options.to_s.value_or(kMostSeconds))};
  const auto kept = recording::trim(options.file, options.to, asked);
  if (!kept) return report(kProgram, kept.error());
  std::printf("%s: %" PRIu64 " messages, from %.3f s to %.3f s of %s\n", options.to.c_str(),
              kept->messages, seconds_of(kept->from), seconds_of(kept->to), options.file.c_str());
  if (kept->has_state)
    std::printf("It begins with the state there: verify simulates all of it again.\n");
  else
    std::printf(
        "It was recorded with another sim_version: verify decodes its surfaces, and can "
        "simulate nothing of it again.\n");
  return 0;
}

void add_options(CLI::App& command, SignCommand& options) {
  command.add_option("FILE", options.file, "the journal (.mcap)")->required();
  command.add_option("NEW", options.to, "the file to write, which must not exist")->required();
  command
      .add_option("--key", options.key_file,
                  "private Ed25519 key (PEM), as openssl genpkey -algorithm ed25519 makes one")
      ->type_name("FILE")
      ->required();
}

int sign_recording(const SignCommand& options) {
  const auto key = secure::SigningKey::read(options.key_file);
  if (!key) return report(kProgram, key.error());
  const auto signed_here = recording::sign(options.file, options.to, *key);
  if (!signed_here) return report(kProgram, signed_here.error());
  std::printf("%s: %" PRIu64 " messages, signed with the key of %s\n", options.to.c_str(),
              signed_here->messages, options.key_file.c_str());
  if (!signed_here->note.empty()) std::printf("%s\n", signed_here->note.c_str());
  return 0;
}

}  // namespace trocar::app
