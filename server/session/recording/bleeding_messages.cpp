#include "server/session/recording/bleeding_messages.h"

namespace trocar::recording {
namespace {

template <typename Field>
void write(const Vec3d& place, Field& field) {
  for (const double value : {place.x, place.y, place.z}) field.Add(value);
}

template <typename Field>
bool read(const Field& field, Vec3d& place) {
  if (field.size() != 3) return false;
  place = {field.Get(0), field.Get(1), field.Get(2)};
  return true;
}

}  // namespace

void to_message(const bleeding::Rules& rules, proto::BleedingRules& message) {
  message.set_ooze_m_s(rules.ooze_m_s);
  message.set_clotting_time_s(rules.clotting_time_s);
  message.set_ooze_pressure_pa(rules.ooze_pressure_pa);
  for (const auto& vessel : rules.vessels) {
    auto& entry = *message.add_vessel();
    entry.set_name(vessel.name);
    write(vessel.from_m, *entry.mutable_from_m());
    write(vessel.to_m, *entry.mutable_to_m());
    entry.set_radius_m(vessel.radius_m);
    entry.set_pressure_pa(vessel.pressure_pa);
    entry.set_most_flow_m3_s(vessel.most_flow_m3_s);
  }
}

Result<bleeding::Rules> from_message(const proto::BleedingRules& message) {
  bleeding::Rules rules{.ooze_m_s = message.ooze_m_s(),
                        .clotting_time_s = message.clotting_time_s(),
                        .ooze_pressure_pa = message.ooze_pressure_pa(),
                        .vessels = {}};
  for (const auto& entry : message.vessel()) {
    bleeding::Vessel vessel{.name = entry.name(),
                            .from_m = {},
                            .to_m = {},
                            .radius_m = entry.radius_m(),
                            .pressure_pa = entry.pressure_pa(),
                            .most_flow_m3_s = entry.most_flow_m3_s()};
    if (!read(entry.from_m(), vessel.from_m) || !read(entry.to_m(), vessel.to_m))
      return Error{ErrorCode::BadFile, "vessel.from_m, to_m: are not three numbers each"};
    rules.vessels.push_back(std::move(vessel));
  }
  if (const auto valid = bleeding::validate(rules); !valid) return valid.error();
  return rules;
}

Result<std::optional<bleeding::Rules>> recorded_bleeding(journal::SessionJournal& journal,
                                                         const std::string& path) {
  const auto message = journal.bleeding();
  if (!message) return message.error();
  if (!*message) return std::optional<bleeding::Rules>();
  auto rules = from_message(**message);
  if (!rules) return Error{rules.error().code, path + ": /bleeding: " + rules.error().message};
  return std::optional<bleeding::Rules>(std::move(*rules));
}

}  // namespace trocar::recording
