#include "common/command_line/limits.h"

#include "common/base/nearest_word.h"

namespace trocar::command_line {

CLI::Validator one_of(std::vector<std::string> words) {
  const std::string shown = fmt::format("{{{}}}", fmt::join(words, ","));
  return {[words = std::move(words)](std::string& text) {
            for (const auto& word : words)
              if (word == text) return std::string();
            return fmt::format("{} is none of {}{}", text, fmt::join(words, ", "),
                               did_you_mean(text, words));
          },
          shown};
}

}  // namespace trocar::command_line
