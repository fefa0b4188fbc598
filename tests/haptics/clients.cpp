#include "tests/haptics/clients.h"

#include <algorithm>

#include "client/haptics/safety.h"

namespace trocar::haptics::testing {
namespace {

class Model : public Client {
 public:
  Model(const tool::ToolShape& shape, const std::vector<wire::HapticLaw>& laws,
        const TouchSettings& settings, ChangePatch change)
      : model_(shape, settings), change_(std::move(change)) {
    for (const auto& law : laws) model_.take(law);
  }
  void take(const wire::HapticPatch& patch) override {
    wire::HapticPatch changed = patch;
    if (change_) change_(changed, now_us_);
    model_.take(changed);
  }
  TouchOutput step(const TouchInput& input) override {
    now_us_ = input.time_us;
    return model_.step(input);
  }

 private:
  TouchModel model_;
  ChangePatch change_;
  std::uint64_t now_us_ = 0;
};

// A force from the newest patch alone, blended over 15 ms when one comes.
class Scheme : public Client {
 public:
  using Force = std::function<Vec3d(const wire::HapticPatch&, const TouchInput&)>;
  explicit Scheme(Force force) : force_(std::move(force)) {}

  void take(const wire::HapticPatch& patch) override {
    if (has_patch_ && patch.sequence <= patch_.sequence) return;
    patch_ = patch;
    has_patch_ = is_new_ = true;
  }
  TouchOutput step(const TouchInput& input) override {
    TouchOutput output;
    if (!has_patch_) return output;
    Vec3d force_n = force_(patch_, input);
    if (is_new_) {
      jump_n_ = last_n_ - force_n;
      left_ = 1;
      is_new_ = false;
    }
    force_n += jump_n_ * left_;
    left_ = std::max(0.0, left_ - 1.0 / 15);
    const Vec3d normal = to_double(patch_.plane_normal);
    if (patch_.kind != wire::TouchKind::Grip)
      force_n += normal * std::max(0.0, -dot(force_n, normal));
    last_n_ = output.force_n = force_n;
    return output;
  }

 private:
  Force force_;
  wire::HapticPatch patch_;
  bool has_patch_ = false, is_new_ = false;
  Vec3d last_n_, jump_n_;
  double left_ = 0;
};

class SafeClient : public Client {
 public:
  explicit SafeClient(std::unique_ptr<Client> client) : client_(std::move(client)) {}
  void take(const wire::HapticPatch& patch) override {
    client_->take(patch);
    patch_us_ = now_us_;
  }
  TouchOutput step(const TouchInput& input) override {
    now_us_ = input.time_us;
    TouchOutput output = client_->step(input);
    SafetyInput given;
    given.force_n = output.force_n;
    given.position_m = input.tip_m;
    given.stiffness_n_m = output.stiffness_n_m;
    given.patch_age_s = static_cast<double>(now_us_ - patch_us_) * 1e-6;
    given.touches = output.touches;
    output.force_n = safety_.step(given).force_n;
    return output;
  }

 private:
  std::unique_ptr<Client> client_;
  Safety safety_{{.force_n = 3.3}};
  std::uint64_t now_us_ = 0, patch_us_ = 0;
};

Vec3d with_friction(const wire::HapticPatch& patch, const Vec3d& force_n) {
  if (patch.kind == wire::TouchKind::Grip) return force_n;
  const Vec3d normal = to_double(patch.plane_normal);
  const double along_n = std::max(0.0, dot(force_n, normal));
  Vec3d across_n = force_n - normal * dot(force_n, normal);
  const double most_n = patch.friction * along_n;
  if (length(across_n) > most_n) across_n *= most_n / length(across_n);
  return normal * along_n + across_n;
}

bool touches(const wire::HapticPatch& patch) {
  return patch.kind != wire::TouchKind::Free && patch.kind != wire::TouchKind::Near;
}

constexpr double kPenalty_n_m = 1000, kFace_n_m = 3000;
constexpr double kVelocity_s = 0.004, kShare_s = 0.05;

// How deep the tool is behind the surface that the server's tool had pressed.
double penalty_depth(const wire::HapticPatch& patch, const Vec3d& tip_m) {
  const Vec3d normal = to_double(patch.plane_normal), force_n = to_double(patch.force_n);
  const Vec3d surface_m = touches(patch) ? to_double(patch.used_position_m) +
                                               normal * (dot(force_n, normal) / kFace_n_m)
                                         : to_double(patch.plane_point_m);
  const double depth_m = dot(normal, surface_m - tip_m);
  return patch.kind == wire::TouchKind::Grip ? depth_m : std::max(0.0, depth_m);
}

Vec3d penalty_force(const wire::HapticPatch& patch, const Vec3d& tip_m, double stiffness_n_m) {
  const Vec3d normal = to_double(patch.plane_normal), force_n = to_double(patch.force_n);
  return with_friction(patch, normal * (stiffness_n_m * penalty_depth(patch, tip_m)) +
                                  (force_n - normal * dot(force_n, normal)));
}

SymMat3<double> symmetric(const SymMat3f& k) {
  return {k.xx, k.xy, k.xz, k.yy, k.yz, k.zz};
}

}  // namespace

std::unique_ptr<Client> make_model(const tool::ToolShape& shape,
                                   const std::vector<wire::HapticLaw>& laws,
                                   const TouchSettings& settings, const ChangePatch& change) {
  return std::make_unique<Model>(shape, laws, settings, change);
}

std::unique_ptr<Client> make_safe(std::unique_ptr<Client> client) {
  return std::make_unique<SafeClient>(std::move(client));
}

std::unique_ptr<Client> make_hold() {
  return std::make_unique<Scheme>(
      [](const wire::HapticPatch& patch, const TouchInput&) { return to_double(patch.force_n); });
}

std::unique_ptr<Client> make_linear(double stiffness_factor) {
  return std::make_unique<Scheme>([=](const wire::HapticPatch& patch, const TouchInput& input) {
    const SymMat3<double> stiffness = symmetric(patch.stiffness_n_m);
    const Vec3d normal = to_double(patch.plane_normal);
    if (!touches(patch)) {
      const double depth_m = dot(normal, to_double(patch.plane_point_m) - input.tip_m);
      return normal * std::max(0.0, depth_m * dot(normal, stiffness * normal) * stiffness_factor);
    }
    const Vec3d way_m = input.tip_m - to_double(patch.used_position_m);
    return with_friction(patch, to_double(patch.force_n) - stiffness * way_m * stiffness_factor);
  });
}

std::unique_ptr<Client> make_penalty() {
  return std::make_unique<Scheme>([](const wire::HapticPatch& patch, const TouchInput& input) {
    return penalty_force(patch, input.tip_m, kPenalty_n_m);
  });
}

std::unique_ptr<Client> make_scaled_penalty() {
  struct Motion {
    Vec3d tip_m, velocity_m_s;
    std::uint64_t time_us = 0;
    double share = 1;  // of the stiffness
  };
  return std::make_unique<Scheme>(
      [last = Motion{}](const wire::HapticPatch& patch, const TouchInput& input) mutable {
        const Vec3d normal = to_double(patch.plane_normal);
        const double dt_s = static_cast<double>(input.time_us - last.time_us) * 1e-6;
        if (last.time_us != 0) {
          const Vec3d velocity_m_s = (input.tip_m - last.tip_m) / dt_s;
          last.velocity_m_s += (velocity_m_s - last.velocity_m_s) * (dt_s / (dt_s + kVelocity_s));
          const double tissue_n_m = dot(normal, symmetric(patch.stiffness_n_m) * normal);
          // The tissue gives way by this share of a motion, which the old surface does not show.
          const double yields = kPenalty_n_m / (kPenalty_n_m + std::max(0.0, tissue_n_m));
          const double inwards_m_s = std::max(0.0, -dot(normal, last.velocity_m_s));
          const double lag_s = static_cast<double>(input.time_us - patch.echo_time_us) * 1e-6;
          const double depth_m = std::max(1e-4, penalty_depth(patch, input.tip_m));
          const double due_m = std::max(1e-4, (1 - yields) * depth_m);
          const double share = due_m / (due_m + yields * inwards_m_s * lag_s);
          last.share += (std::clamp(share, 0.05, 1.0) - last.share) * (dt_s / kShare_s);
        }
        last.tip_m = input.tip_m;
        last.time_us = input.time_us;
        return penalty_force(patch, input.tip_m, kPenalty_n_m * last.share);
      });
}

}  // namespace trocar::haptics::testing
