#include "tests/validation/measured_livers.h"

#include <spdlog/fmt/fmt.h>

#include "common/base/assert.h"
#include "server/organs/catalogue/builtin_organs.h"

namespace trocar::validation {
namespace {

constexpr int kShortTets = 2000;

MeasuredLiver make(const char* name, const char* what, organ::Organ organ) {
  material::use_measured(*material::find_measured_material("human_liver_nava2008"), organ.material);
  const auto title =
      fmt::format("{}, {} nodes, {} tets", what, organ.mesh.node_count(), organ.mesh.tets.size());
  return {name, title, std::move(organ)};
}

}  // namespace

std::vector<MeasuredLiver> measured_livers(const Lab& lab) {
  auto built_in = catalogue::make_liver(lab.is_short() ? kShortTets : catalogue::kDefaultLiverTets);
  TROCAR_ASSERT(built_in.ok());
  std::vector<MeasuredLiver> livers{make("liver", "built-in liver", std::move(*built_in))};
  return livers;
}

}  // namespace trocar::validation
