#include "tests/validation/live_livers.h"

#include <spdlog/fmt/fmt.h>

#include <cmath>
#include <map>

namespace trocar::validation {

reduce::LocalSettings live_settings(const Lab& lab) {
  reduce::LocalSettings settings{.patches = 12, .threads = 2};
  if (lab.is_short())
    settings.modes = 16, settings.directions = 2, settings.field_nodes = 5, settings.patches = 3,
    settings.patch_radius_m = 0.02;
  return settings;
}

std::string live_training_text(const Lab& lab) {
  const auto s = live_settings(lab);
  return fmt::format(
      "The reduction: {} patches of {:.0f} mm, {} modes, {} of inertia and {} vibrations each, "
      "trained by presses of single nodes at the patches' centres, {} directions, up to {} N.",
      s.patches, 1e3 * s.patch_radius_m, s.modes, s.inertia_modes, s.vibrations, s.directions,
      s.force_n);
}

std::vector<std::shared_ptr<const LiveLiver>> live_livers(const Lab& lab) {
  static std::map<std::string, std::shared_ptr<const LiveLiver>> made;
  std::vector<std::shared_ptr<const LiveLiver>> livers;
  for (auto& liver : measured_livers(lab)) {
    auto& kept = made[liver.name];
    if (!kept) {
      auto reduction = make_live_reduction(liver.name, liver.organ, live_settings(lab));
      kept = std::make_shared<LiveLiver>(std::move(liver), std::move(reduction));
    }
    livers.push_back(kept);
  }
  return livers;
}

double norm_of(const LiveField& field) {
  double sum = 0;
  for (const auto& u : field) sum += static_cast<double>(length_squared(u));
  return std::sqrt(sum);
}

}  // namespace trocar::validation
