#include "tests/haptics/closed_loop.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <vector>

namespace trocar::haptics::testing {
namespace {

constexpr double kQuantum_m = 20e-6;  // of the device
constexpr int kServerRamp = 10;       // ticks in which the server's tool reaches a reading

struct Reading {
  double s = 0;
  Vec3d tip_m;
};
// The last readings go together, so that a lost datagram costs nothing but time.
using Readings = std::array<Reading, 3>;

class HeldDevice {
 public:
  explicit HeldDevice(const Hand& hand) : hand_(hand) {}
  Vec3d reading_m() const {
    const auto rounded = [](double x) { return std::round(x / kQuantum_m) * kQuantum_m; };
    return {rounded(hand_.place_m.x), rounded(hand_.place_m.y), rounded(hand_.place_m.z)};
  }
  void step(const Vec3d& wanted_m, const Vec3d& force_n) {
    misses_.push_back(hand_.place_m - wanted_m);
    Vec3d reflex_n;
    if (misses_.size() > static_cast<std::size_t>(hand_.reflex_s / kDt_s)) {
      reflex_n = misses_.front() * -hand_.reflex_n_m;
      misses_.pop_front();
    }
    for (int i = 0; i < 10; ++i) {
      const Vec3d f = force_n + reflex_n + (wanted_m - hand_.place_m) * hand_.stiffness_n_m -
                      hand_.speed_m_s * hand_.damping_n_s_m;
      hand_.speed_m_s += f * (kDt_s / 10 / hand_.mass_kg);
      hand_.place_m += hand_.speed_m_s * (kDt_s / 10);
    }
  }

 private:
  Hand hand_;
  std::deque<Vec3d> misses_;
};

// The server's side: it moves its tool to a reading within some ticks, and its idea of the client's
// time along with it.
class Server {
 public:
  Server(const Motion& motion, const TissueFigures& figures, const Frame& frame)
      : motion_(motion), tissue_(figures), frame_(frame), friction_(figures.friction) {}

  void take(const Reading& reading) {
    if (reading.s <= newest_.s) return;
    newest_ = reading;
    left_ = kServerRamp;
  }
  void tick(double now_s) {
    if (left_ > 0) {
      tip_m_ += (newest_.tip_m - tip_m_) * (1.0 / left_);
      used_s_ += (newest_.s - used_s_) / left_--;
    } else {
      used_s_ += kDt_s;
    }
    used_s_ = std::min(used_s_, now_s);
    change(tissue_, tip_m_, now_s, cut_s_);
    const bool is_new = tissue_.is_refused != was_refused_ || tissue_.scale != last_scale_ ||
                        tissue_.is_grasped() != was_grasped_;
    if (is_new) ++structure_;
    was_refused_ = tissue_.is_refused;
    was_grasped_ = tissue_.is_grasped();
    last_scale_ = tissue_.scale;
  }
  // Steps a tissue and lets happen to it what happens.
  void change(SurrogateTissue& tissue, const Vec3d& tip_m, double now_s, double& cut_s) const {
    if (motion_.happens) motion_.happens(now_s, tissue);
    if (motion_.grasp_s >= 0)
      tissue.set_grasped(now_s >= motion_.grasp_s && now_s < motion_.release_s, tip_m);
    tissue.step(tip_m);
    if (motion_.cut_n > 0) {
      if (cut_s < 0 && tissue.force_n().z > motion_.cut_n) cut_s = now_s;
      if (cut_s >= 0) tissue.scale = std::max(0.05, 1 - (now_s - cut_s) / 0.003);
    }
  }
  void start_at(const Vec3d& tip_m) { tip_m_ = tip_m; }

  wire::HapticPatch patch() {
    wire::HapticPatch patch;
    patch.sequence = ++sequence_;
    patch.structure = structure_;
    patch.echo_time_us = static_cast<std::uint64_t>(std::llround(used_s_ * 1e6)) + kClockStart_us;
    const auto place = [&](const Vec3d& v) { return to_float(frame_.to_world(v) + frame_.origin); };
    patch.used_position_m = place(tip_m_);
    patch.kind = tissue_.is_refused     ? wire::TouchKind::Rigid
                 : tissue_.is_grasped() ? wire::TouchKind::Grip
                 : tissue_.touches()    ? wire::TouchKind::Push
                                        : wire::TouchKind::Near;
    patch.force_n = to_float(frame_.to_world(tissue_.force_n()));
    patch.plane_point_m = place(tissue_.surface_under(tip_m_));
    const Vec3d normal = frame_.to_world(tissue_.normal_at(tip_m_));
    patch.plane_normal = to_float(normal);
    patch.has_stiffness = patch.kind != wire::TouchKind::Near;  // the client guesses
    const auto across = static_cast<float>(tissue_.stiffness_across_n_m());
    patch.stiffness_n_m.add_identity(across);
    patch.stiffness_n_m.add_outer(to_float(normal),
                                  static_cast<float>(tissue_.stiffness_along_n_m()) - across);
    patch.friction = static_cast<float>(friction_);
    patch.grip_point_m = place(tissue_.grip_point_m());
    patch.law = 1;
    return patch;
  }

  static constexpr std::uint64_t kClockStart_us = 5'000'000;

 private:
  const Motion& motion_;
  SurrogateTissue tissue_;
  Frame frame_;
  double friction_;
  Reading newest_{-1, {}};
  Vec3d tip_m_;
  double used_s_ = 0, cut_s_ = -1;
  int left_ = 0;
  bool was_refused_ = false, was_grasped_ = false;
  double last_scale_ = 1;
  std::uint32_t structure_ = 0, sequence_ = 0;
};

}  // namespace

Frame Frame::tilted() {
  Frame frame;
  frame.z = normalized(Vec3d{0.3, 0.8, -0.5}, {0, 0, 1});
  frame.x = normalized(cross(Vec3d{0, 1, 0}, frame.z), {1, 0, 0});
  frame.y = cross(frame.z, frame.x);
  frame.origin = {0.05, -0.02, 0.11};
  return frame;
}

Measured measured_of(const Motion& motion) {
  return {.frequency_hz = motion.frequency_hz,
          .steady_from_s = motion.steady_from_s,
          .cut_n = motion.cut_n,
          .is_free = motion.grasp_s < 0};
}

Outcome run(const Motion& motion, TissueFigures figures, const MakeClient& make_client,
            const Line& line, const Hand& hand, std::uint64_t seed) {
  figures.bump_m = motion.bump_m;
  const Frame frame = Frame::tilted();
  Server server(motion, figures, frame);
  SurrogateTissue truth(figures);
  const auto client = make_client();
  Channel<Readings> up(line, line.reading_hz, seed * 7 + 1);
  Channel<wire::HapticPatch> down(line, line.patch_hz, seed * 13 + 5);
  HeldDevice device(hand);
  server.start_at(hand.place_m);
  Readings readings{{{-1, hand.place_m}, {-1, hand.place_m}, {-1, hand.place_m}}};
  Record record;
  double next_reading_s = 0, next_patch_s = 0;
  const int count = static_cast<int>(motion.seconds / kDt_s);
  for (int k = 0; k < count; ++k) {
    const double s = k * kDt_s;
    const Vec3d tip_m = device.reading_m();
    if (s >= next_reading_s - 1e-9) {
      next_reading_s += 1 / line.reading_hz;
      readings = {readings[1], readings[2], {s, tip_m}};
      up.send(s, readings);
    }
    up.deliver(s, [&](const Readings& some) {
      for (const Reading& reading : some) server.take(reading);
    });
    server.tick(s);
    server.change(truth, tip_m, s, record.cut_s);
    if (s >= next_patch_s - 1e-9) {
      next_patch_s += 1 / line.patch_hz;
      down.send(s, server.patch());
    }
    down.deliver(s, [&](const wire::HapticPatch& patch) { client->take(patch); });

    TouchInput input;
    input.tip_m = frame.to_world(tip_m) + frame.origin;
    input.orientation = rotation_from_z(to_float(frame.z));
    const bool holds = motion.grasp_s >= 0 && s >= motion.grasp_s && s < motion.release_s;
    input.verb = holds ? tool::Verb::Grasp : tool::Verb::Push;
    input.time_us = Server::kClockStart_us + static_cast<std::uint64_t>(k) * 1000;
    const Vec3d force_n = frame.to_surface(client->step(input).force_n);
    record.tip_m.push_back(tip_m);
    record.rendered_n.push_back(force_n);
    record.true_n.push_back(truth.force_n());
    device.step(motion.wanted_m(s), force_n);
  }
  return measure(measured_of(motion), record);
}

}  // namespace trocar::haptics::testing
