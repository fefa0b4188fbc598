#pragma once

// Classes are one idea each, and functions can be read at once: both have few names and lines. What
// is larger than that is listed or counted, and the lists may only shrink.

#include <span>
#include <string_view>

#include "tests/architecture/rules.h"

namespace trocar::architecture {

inline constexpr std::size_t kMostNames = 50;  // methods and members of a class
inline constexpr std::size_t kMostLines = 60;  // from a function's name to its end
inline constexpr std::size_t kMostParameters = 6;

// A class may have so many names, and no fewer, for a reason that somebody may take away.
struct LargeClass {
  std::string_view folder, name;
  std::size_t names = 0;
  std::string_view reason;
};

// Each class has at most kMostNames names, or as many as its entry says.
Breaches check_classes(const SourceTree& tree, std::span<const LargeClass> large);

// Functions with a body that are longer than kMostLines, or take more than kMostParameters, are so
// many; if there are fewer, the number is to follow.
Breaches check_functions(const SourceTree& tree, std::size_t long_functions,
                         std::size_t wide_functions);

}  // namespace trocar::architecture
