#pragma once

// CRTK's topics of some arms on DDS, in ROS 2's names and types (ros_types.idl):
//
//   takes   NAME/servo_cp, servo_cf, jaw/servo_jp, state_command
//   gives   NAME/measured_cp, measured_cv, measured_cf, measured_js, jaw/measured_js,
//           operating_state (also to who comes late), warning, error
//
// All are reliable; of servo commands only the newest is kept, and of each topic only a few: a
// flood costs time of DDS' own threads, and no memory. A sample of more than 64 kB is never put
// together. Thread: one; DDS has threads of its own.

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/crtk/operating_state.h"
#include "client/crtk/servo.h"
#include "common/base/result.h"

namespace trocar::crtk {

struct BusSettings {
  std::uint32_t domain = 0;  // 0 to 232, ROS_DOMAIN_ID
  std::string interface;     // a network interface; empty: programs of this machine alone
};

struct BusArm {
  std::string name;
  std::string frame;  // of the headers
  bool has_jaw = true;
  std::vector<std::string> joint_names;
};

class Bus {
 public:
  static constexpr std::uint32_t kMostDomain = 232;

  static Result<std::unique_ptr<Bus>> open(const BusSettings& settings, std::vector<BusArm> arms);
  ~Bus();
  Bus(const Bus&) = delete;
  Bus& operator=(const Bus&) = delete;

  // Until something has come, at most so long.
  void wait(std::uint64_t most_ns);

  // The newest that has come for arm number `arm` since the last call; nothing: none has.
  std::optional<ServoPose> take_pose(std::size_t arm);
  std::optional<ServoWrench> take_wrench(std::size_t arm);
  std::optional<ServoJaw> take_jaw(std::size_t arm);
  // Returns all that wait, oldest first, at most ten.
  std::vector<std::string> take_commands(std::size_t arm);

  void give(std::size_t arm, const Measured& measured);
  void give(std::size_t arm, const OperatingState& state);
  void warn(std::size_t arm, const std::string& text);
  void tell_error(std::size_t arm, const std::string& text);

 private:
  struct Topics;

  Bus();
  Status create(const BusSettings& settings);
  Status create_topics(const BusArm& arm);

  std::vector<BusArm> arms_;
  std::vector<Topics> topics_;
  int domain_ = 0, participant_ = 0, waitset_ = 0;  // handles of DDS
};

}  // namespace trocar::crtk
