#include "tests/validation/measured_livers.h"

#include <spdlog/fmt/fmt.h>

#include <cstdlib>

#include "common/base/assert.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/organs/catalogue/load_organ.h"

namespace trocar::validation {
namespace {

constexpr int kShortTets = 2000;
constexpr const char* kImported = "organs/liver_coarse.msh";

// As tests/support/shared.h finds it.
std::filesystem::path shared_folder() {
  if (const char* set = std::getenv("TROCAR_SHARED")) return set;
  return std::filesystem::path(TROCAR_SOURCE_DIR).parent_path() / "shared";
}

MeasuredLiver make(const char* name, const char* what, organ::Organ organ) {
  material::use_measured(*material::find_measured_material("human_liver_nava2008"), organ.material);
  const auto title =
      fmt::format("{}, {} nodes, {} tets", what, organ.mesh.node_count(), organ.mesh.tets.size());
  return {name, title, std::move(organ)};
}

}  // namespace

std::vector<MeasuredLiver> measured_livers(const Lab& lab, Section& section) {
  auto built_in = catalogue::make_liver(lab.is_short() ? kShortTets : catalogue::kDefaultLiverTets);
  TROCAR_ASSERT(built_in.ok());
  std::vector<MeasuredLiver> livers{make("liver", "built-in liver", std::move(*built_in))};
  if (lab.is_short()) return livers;
  const auto path = shared_folder() / kImported;
  if (!std::filesystem::exists(path)) {
    section.say(fmt::format("LEFT OUT: the imported liver, {} is not there (see TROCAR_SHARED).",
                            kImported));
    return livers;
  }
  auto imported = catalogue::load_organ(path.string());
  TROCAR_ASSERT(imported.ok());
  livers.push_back(make("liver-coarse", "imported liver", std::move(*imported)));
  return livers;
}

}  // namespace trocar::validation
