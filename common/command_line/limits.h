#pragma once

#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include <string>

namespace trocar {

// Checks an option of the command line. Unlike CLI::Range it refuses what is not a number.
inline CLI::Validator from_to(double least, double most) {
  return {[=](std::string& text) {
            double value = 0;
            if (CLI::detail::lexical_cast(text, value) && value >= least && value <= most)
              return std::string();
            return fmt::format("{} is not a number from {} to {}", text, least, most);
          },
          fmt::format("{} to {}", least, most)};
}

}  // namespace trocar
