#pragma once

// trocar-sim --hands: the hands of a recorded session on another organ. Samples and decisions of
// each tick are those of the recording; what the tissue does is simulated anew. Anchors do not
// move: a tool goes where it went in the session, whatever is there. A scenario's loads go along
// where the nodes are the same, so on the same organ of another material, too. It starts in the
// recorded equilibrium on the recording's own organ, on others at rest.

#include <CLI/CLI.hpp>
#include <csignal>
#include <filesystem>
#include <string>

#include "common/base/result.h"

namespace trocar::app {

struct HandsCommand {
  std::string recording;  // empty: not asked for
  std::string organ;      // empty: the recording's own
};

void add_hands_options(CLI::App& app, HandsCommand& command);

// Writes hands.csv, a row per tool and frame, and the field at the end. journal: file, or empty.
Status run_hands(const HandsCommand& command, const std::filesystem::path& folder,
                 const std::string& journal, unsigned threads,
                 const volatile std::sig_atomic_t& stop);

}  // namespace trocar::app
