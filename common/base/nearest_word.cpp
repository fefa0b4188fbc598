#include "common/base/nearest_word.h"

#include <algorithm>
#include <vector>

namespace trocar {
namespace {

// Longer words are nobody's typing error.
constexpr std::size_t kMostLetters = 64;

// Counts changes of one letter, and exchanges of two neighbours, that make one word of the other.
std::size_t changes_between(std::string_view a, std::string_view b) {
  std::vector<std::size_t> before(b.size() + 1), last(b.size() + 1), now(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) last[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    now[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      now[j] =
          std::min({last[j] + 1, now[j - 1] + 1, last[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1)});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        now[j] = std::min(now[j], before[j - 2] + 1);
    }
    std::swap(before, last);
    std::swap(last, now);
  }
  return last[b.size()];
}

}  // namespace

std::string nearest_word(std::string_view word, std::span<const std::string> known) {
  if (word.size() > kMostLetters) return {};
  const auto begins = [word](const std::string& other) { return other.starts_with(word); };
  if (word.size() >= 2 && std::count_if(known.begin(), known.end(), begins) == 1)
    return *std::find_if(known.begin(), known.end(), begins);
  std::size_t least = std::max<std::size_t>(1, word.size() / 3) + 1;
  std::string nearest;
  for (const auto& other : known) {
    if (other.size() > kMostLetters) continue;
    const std::size_t changes = changes_between(word, other);
    if (changes > least || (changes == least && nearest.empty())) continue;
    nearest = changes < least ? other : std::string();
    least = changes;
  }
  return nearest;
}

std::string did_you_mean(std::string_view word, std::span<const std::string> known) {
  const auto nearest = nearest_word(word, known);
  return nearest.empty() ? nearest : ", did you mean " + nearest + "?";
}

}  // namespace trocar
