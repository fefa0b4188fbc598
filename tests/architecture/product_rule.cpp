#include "tests/architecture/product_rule.h"

#include <algorithm>
#include <array>

namespace trocar::architecture {
namespace {

constexpr std::array kProduct{"common/",
                              "client/",
                              "server/organs/",
                              "server/tissue/",
                              "server/session/",
                              "server/app/config/",
                              "server/app/server/",
                              "server/app/web/",
                              "server/app/relay/",
                              "server/bus/",
                              "server/watch/",
                              "server/hall/",
                              "server/app/hall/",
                              "server/web/",
                              "server/app/journal/",
                              "server/app/impair/"};
constexpr std::array kApart{"server/papers/", "server/lab/"};
constexpr std::array kTools{"client/editor/"};  // among them; no session runs these

template <std::size_t kCount>
bool is_in(const std::array<const char*, kCount>& wings, const std::string& folder) {
  return std::ranges::any_of(wings, [&](const char* wing) { return folder.starts_with(wing); });
}

bool is_product(const std::string& folder) {
  return is_in(kProduct, folder + "/") && !is_in(kTools, folder + "/");
}

}  // namespace

Breaches check_product_sees_no_paper(const SourceTree& tree) {
  Breaches breaches;
  for (const auto& layer : tree.layers) {
    if (!is_product(layer)) continue;
    for (const auto& seen : tree.closure_of(layer))
      if (is_in(kApart, seen + "/"))
        breaches.push_back(layer + "/CMakeLists.txt:1: sees " + seen +
                           " through its DEPENDS, give it an interface of its own");
  }
  for (const auto& file : tree.files)
    for (const auto& include : file.includes)
      if (is_product(file.folder) && is_in(kApart, include.target))
        breaches.push_back(file.path + ":" + std::to_string(include.line) + ": includes " +
                           include.target + ", give it an interface of its own");
  return breaches;
}

}  // namespace trocar::architecture
