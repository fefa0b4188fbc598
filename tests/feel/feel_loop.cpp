#include "tests/feel/feel_loop.h"

#include <array>
#include <cmath>
#include <sstream>

#include "common/base/assert.h"
#include "server/tissue/touch/haptic_law.h"

namespace trocar::haptics::testing {
namespace {

// A client sends its readings so.
constexpr double kShortest_s = 0.0039, kKeepAlive_s = 0.020, kDeadBand_m = 60e-6;
constexpr double kAbove_m = 0.02;

using Readings = std::array<ToolReading, 3>;

// A script's places are in millimetres.
device::HandScript script_of(const Motion& motion) {
  std::ostringstream text;
  for (int k = 0; k * kDt_s <= motion.seconds; ++k) {
    const Vec3d wanted_m = motion.wanted_m(k * kDt_s);
    text << k * kDt_s << ' ' << 1e3 * wanted_m.x << ' ' << 1e3 * wanted_m.y << ' '
         << 1e3 * wanted_m.z << '\n';
  }
  auto script = device::HandScript::parse_keys(text.str(), motion.name);
  TROCAR_ASSERT(script.ok());
  return *script;
}

// Sends what a client sends: readings that differ, and one now and then that does not.
class Uplink {
 public:
  explicit Uplink(const FeelSettings& settings)
      : line_(settings.line, settings.line.reading_hz, settings.seed * 7 + 1) {}

  void offer(double s, const ToolReading& reading) {
    const double since_s = s - last_s_;
    const bool is_same = length(reading.tip_m - last_[2].tip_m) < kDeadBand_m &&
                         reading.verb == last_[2].verb && since_s < kKeepAlive_s;
    const bool is_soon = since_s < kShortest_s && reading.verb == last_[2].verb;
    if (is_same || is_soon) return;
    last_ = {last_[1], last_[2], reading};
    last_s_ = s;
    line_.send(s, last_);
  }
  // The newest that has come, if it is newer than the one before.
  const ToolReading* deliver(double s) {
    bool is_new = false;
    line_.deliver(s, [&](const Readings& some) {
      for (const auto& reading : some) {
        if (reading.time_us <= newest_.time_us) continue;
        newest_ = reading;
        is_new = true;
      }
    });
    return is_new ? &newest_ : nullptr;
  }

 private:
  Channel<Readings> line_;
  Readings last_;
  ToolReading newest_;
  double last_s_ = -1;
};

Frame frame_of(const Vec3d& origin_m, const Vec3d& direction) {
  Frame frame;
  frame.z = direction;
  const Vec3d other = std::abs(direction.x) < 0.9 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
  frame.x = normalized(other - direction * dot(other, direction), {});
  frame.y = cross(frame.z, frame.x);
  frame.origin = origin_m;
  return frame;
}

}  // namespace

FeelRecord run(const step::Simulation& simulation, const tool::ToolShape& shape, const Frame& place,
               const FeltMotion& felt, const MakeOrganClient& make_client,
               const FeelSettings& settings) {
  const Motion& motion = felt.motion;
  FeltOrgan server(simulation, shape), truth(simulation, shape);
  server.decide(felt.decisions);
  const auto client = make_client(touch::haptic_laws(simulation.organ()));
  std::uint64_t now_us = 0;
  device::SimulatedDevice device(
      script_of(motion), [&] { return now_us; }, settings.hand);
  Uplink up(settings);
  Channel<wire::HapticPatch> down(settings.line, settings.line.patch_hz, settings.seed * 13 + 5);
  const Quatf orientation = rotation_from_z(to_float(place.z));
  const ToolReading* waiting = nullptr;  // until the server's next tick
  const auto pause = static_cast<int>(std::lround(1 / felt.server_pace));
  FeelRecord record;
  Vec3d server_n;
  for (int k = 0; k < static_cast<int>(motion.seconds / kDt_s); ++k) {
    const double s = k * kDt_s;
    now_us = static_cast<std::uint64_t>(k) * 1000;
    const bool is_gone = s >= felt.gone_s && s < felt.back_s;
    const Vec3d tip_m = device.read()->position_m;
    const ToolReading reading{.tip_m = place.to_world(tip_m) + place.origin,
                              .orientation = orientation,
                              .verb = felt.verb ? felt.verb(s) : tool::Verb::Push,
                              .time_us = kClockStart_us + now_us};
    if (!is_gone) up.offer(s, reading);
    if (const ToolReading* newest = up.deliver(s)) waiting = newest;
    if (k % pause == 0) {
      if (felt.others) felt.others(s, server.others());
      if (felt.decides) {
        auto decisions = felt.decisions;
        felt.decides(s, decisions);
        server.decide(decisions);
      }
      const auto given = [&](const hands::ToolInput& wanted) { return felt.given(s, wanted); };
      server.tick(waiting, felt.given ? Given(given) : nullptr);
      waiting = nullptr;
    }
    if (felt.others) felt.others(s, truth.others());
    truth.tick_at(reading);
    if (auto patch = server.pop_patch(); patch && !is_gone) {
      if (settings.at_server) settings.at_server(*patch, server);
      down.send(s, *patch);
    }
    down.deliver(s, [&](const wire::HapticPatch& patch) {
      client->take(patch);
      server_n = place.to_surface(to_double(patch.force_n));
    });
    const TouchOutput output = client->step({.tip_m = reading.tip_m,
                                             .orientation = orientation,
                                             .verb = reading.verb,
                                             .time_us = reading.time_us});
    const Vec3d force_n = place.to_surface(output.force_n);
    record.tip_m.push_back(tip_m);
    record.rendered_n.push_back(force_n);
    record.true_n.push_back(place.to_surface(truth.force_n()));
    record.server_n.push_back(server_n);
    static_cast<void>(device.write(force_n, {}));
  }
  return record;
}

Frame place_at(const step::Simulation& simulation, const tool::ToolShape& shape,
               const Vec3d& point_m, const Vec3d& direction) {
  const auto place_m =
      place_of_contact(simulation, shape, point_m + direction * kAbove_m, -direction);
  TROCAR_ASSERT(place_m);
  return frame_of(*place_m, direction);
}

Frame place_on(const step::Simulation& simulation, const tool::ToolShape& shape,
               const Vec3d& direction) {
  const auto& mesh = simulation.organ().mesh;
  Vec3d farthest_m = mesh.rest_positions[mesh.surface_nodes.front().value];
  for (const auto node : mesh.surface_nodes)
    if (dot(mesh.rest_positions[node.value] - farthest_m, direction) > 0)
      farthest_m = mesh.rest_positions[node.value];
  return place_at(simulation, shape, farthest_m, direction);
}

}  // namespace trocar::haptics::testing
