#include "server/session/recording/load_messages.h"

#include <string>

#include "proto/journal.pb.h"

namespace trocar::recording {
namespace {

using Doubles = google::protobuf::RepeatedField<double>;
using Nodes = google::protobuf::RepeatedField<std::uint32_t>;

void add(const Vec3d& v, Doubles& to) {
  to.Add(v.x);
  to.Add(v.y);
  to.Add(v.z);
}

std::vector<Vec3d> vectors_of(const Doubles& from) {
  std::vector<Vec3d> vectors;
  for (int i = 0; i + 2 < from.size(); i += 3)
    vectors.push_back({from.Get(i), from.Get(i + 1), from.Get(i + 2)});
  return vectors;
}

void write(const std::vector<NodeIndex>& nodes, Nodes& to) {
  for (const auto node : nodes) to.Add(node.value);
}
std::vector<NodeIndex> read(const Nodes& from) {
  std::vector<NodeIndex> nodes;
  for (const auto node : from) nodes.emplace_back(node);
  return nodes;
}

void write(const step::TimedVector& curve, proto::TimedVector& to) {
  for (const auto& [time_s, value] : curve.keys) {
    to.add_time_s(time_s);
    add(value, *to.mutable_value());
  }
}
// A curve whose times and values are not as many has no keys, which no load may have.
step::TimedVector read(const proto::TimedVector& from) {
  step::TimedVector curve;
  const auto values = vectors_of(from.value());
  if (from.value_size() != 3 * from.time_s_size()) return curve;
  for (std::size_t i = 0; i < values.size(); ++i)
    curve.keys.push_back({from.time_s(static_cast<int>(i)), values[i]});
  return curve;
}

}  // namespace

void to_message(const step::LoadRules& rules, proto::ExternalLoads& message) {
  for (const auto& load : rules.displaced) {
    auto& entry = *message.add_displaced();
    write(load.nodes, *entry.mutable_node());
    entry.set_axes(load.axes);
    write(load.over_time, *entry.mutable_displacement_m());
  }
  for (const auto& load : rules.forces) {
    auto& entry = *message.add_loaded();
    write(load.nodes, *entry.mutable_node());
    write(load.over_time, *entry.mutable_over_time());
    entry.mutable_share()->Add(load.shares.begin(), load.shares.end());
    for (const auto& area : load.normal_areas_m2) add(area, *entry.mutable_normal_area_m2());
  }
  message.set_has_measured_reactions(rules.has_measured_reactions);
}

Result<step::LoadRules> from_message(const proto::ExternalLoads& message,
                                     const organ::Organ& organ) {
  step::LoadRules rules;
  for (const auto& entry : message.displaced()) {
    const auto axes = entry.axes() > step::kAllAxes ? 0 : entry.axes();  // 0 is refused
    rules.displaced.push_back(
        {read(entry.node()), static_cast<std::uint8_t>(axes), read(entry.displacement_m())});
  }
  for (const auto& entry : message.loaded()) {
    if (entry.normal_area_m2_size() % 3 != 0)
      return Error{ErrorCode::BadFile, "loaded[" + std::to_string(rules.forces.size()) +
                                           "]: its areas are not three numbers each"};
    rules.forces.push_back({read(entry.node()),
                            read(entry.over_time()),
                            {entry.share().begin(), entry.share().end()},
                            vectors_of(entry.normal_area_m2())});
  }
  rules.has_measured_reactions = message.has_measured_reactions();
  if (auto s = step::validate(rules, organ); !s) return s.error();
  return rules;
}

}  // namespace trocar::recording
