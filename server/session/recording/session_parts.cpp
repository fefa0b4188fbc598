#include "server/session/recording/session_parts.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <utility>

namespace trocar::recording {

std::string mismatch(const journal::SessionInfo& earlier, const journal::SessionInfo& later) {
  if (!later.continues) return "begins with a session of its own";
  const Tick tick = later.continues->tick;
  if (earlier.organ_hash != later.organ_hash) return "has another organ";
  if (earlier.begin_tick() >= tick || earlier.last_tick < tick)
    return fmt::format("goes on after tick {}, which is not among ticks {} to {} of it", tick,
                       earlier.begin_tick() + 1, earlier.last_tick);
  return {};
}

Result<SessionParts> open_session_parts(const std::string& path) {
  auto journal = journal::SessionJournal::open(path);
  if (!journal) return journal.error();
  SessionParts session;
  session.parts.push_back({.path = path, .journal = std::move(*journal)});
  const auto folder = std::filesystem::path(path).parent_path();
  while (const auto& continues = session.parts.back().journal->info().continues) {
    const auto& info = session.parts.back().journal->info();
    // A name alone: a recording leads to no other folder.
    const auto name = std::filesystem::path(continues->file).filename();
    const auto lacks = [&](const std::string& why) {
      session.missing =
          "it goes on with " + name.string() + ", " + why + ": what came before is not here";
    };
    if (session.parts.size() == journal::kMostParts) {
      lacks("and is the " + std::to_string(journal::kMostParts) + "th part");
      break;
    }
    auto before = journal::SessionJournal::open((folder / name).string());
    if (!before) {
      lacks("which has to lie beside it");
      break;
    }
    if (!mismatch((*before)->info(), info).empty()) {
      lacks("and the file of that name is of another session");
      break;
    }
    const Tick until = continues->tick;
    session.parts.push_back(
        {.path = (folder / name).string(), .journal = std::move(*before), .until = until});
  }
  if (const auto& trimmed = session.parts.back().journal->info().trimmed)
    session.missing = "it was cut out of " + trimmed->file + ": what came before is not here";
  std::ranges::reverse(session.parts);
  return session;
}

}  // namespace trocar::recording
