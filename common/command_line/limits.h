#pragma once

// Checks of an option's value on the command line. Each error says what was given and what would
// be right; --help shows the limits.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace trocar::command_line {

// A number. Unlike CLI::Range it refuses what is not one.
inline CLI::Validator from_to(double least, double most) {
  return {[=](std::string& text) {
            double value = 0;
            if (CLI::detail::lexical_cast(text, value) && value >= least && value <= most)
              return std::string();
            return fmt::format("{} is not a number from {} to {}", text, least, most);
          },
          fmt::format("{} to {}", least, most)};
}

// A whole number.
inline CLI::Validator whole_from_to(std::int64_t least, std::int64_t most) {
  return {[=](std::string& text) {
            std::int64_t value = 0;
            if (CLI::detail::lexical_cast(text, value) && value >= least && value <= most)
              return std::string();
            return fmt::format("{} is not a whole number from {} to {}", text, least, most);
          },
          fmt::format("{} to {}", least, most)};
}

// One of these words; the error says which was probably meant.
CLI::Validator one_of(std::vector<std::string> words);

}  // namespace trocar::command_line
