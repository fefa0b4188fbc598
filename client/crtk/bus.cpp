#include "client/crtk/bus.h"

#include <dds/dds.h>
#include <netinet/in.h>
#include <ros_types.h>
#include <sys/socket.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <utility>

#include "common/base/log.h"
#include "common/base/printable.h"
#include "common/base/timing.h"

namespace trocar::crtk {
namespace {

constexpr int kMostWaiting = 10;  // samples of a topic, as ROS 2 has it
constexpr std::size_t kMostCommandBytes = 100;

using PoseMessage = geometry_msgs_msg_dds__PoseStamped_;
using TwistMessage = geometry_msgs_msg_dds__TwistStamped_;
using WrenchMessage = geometry_msgs_msg_dds__WrenchStamped_;
using JointMessage = sensor_msgs_msg_dds__JointState_;
using StateMessage = crtk_msgs_msg_dds__OperatingState_;
using CommandMessage = crtk_msgs_msg_dds__StringStamped_;
using TextMessage = std_msgs_msg_dds__String_;

// Only this machine's programs are found where no interface was chosen, and found without
// multicast, which a loopback interface seldom has. What CYCLONEDDS_URI says comes last and counts.
std::string configuration(const BusSettings& settings) {
  const bool is_local = settings.interface.empty();
  std::string text = "<CycloneDDS><Domain Id=\"any\"><General><Interfaces><NetworkInterface ";
  text += is_local ? "address=\"127.0.0.1\"" : "name=\"" + settings.interface + "\"";
  text += "/></Interfaces>";
  if (is_local) text += "<AllowMulticast>false</AllowMulticast>";
  text += "</General><Discovery><ParticipantIndex>auto</ParticipantIndex>";
  text += "<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>";
  if (is_local) text += "<Peers><Peer Address=\"127.0.0.1\"/></Peers>";
  text += "</Discovery><Internal><MaxSampleSize>64 kB</MaxSampleSize></Internal>";
  text += "</Domain></CycloneDDS>";
  const char* const own = std::getenv("CYCLONEDDS_URI");
  return own != nullptr && *own != '\0' ? text + "," + own : text;
}

// DDS speaks through our log, which holds a flood back. On its threads.
void pass_on(void*, const dds_log_data_t* line) {
  std::string_view text(line->message, line->size);
  while (text.ends_with('\n')) text.remove_suffix(1);
  log::warn("DDS: {}", printable(text));
}

// Cyclone DDS takes datagrams from everywhere, whatever its interface is. From now on the sockets
// that are open take those of this machine alone. False: the system does not do that.
bool keep_to_loopback() {
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd", error)) {
    const int socket = std::atoi(entry.path().filename().c_str());
    int type = 0;
    sockaddr_in address{};
    socklen_t type_size = sizeof(type), address_size = sizeof(address);
    const bool is_of_dds =
        ::getsockopt(socket, SOL_SOCKET, SO_TYPE, &type, &type_size) == 0 && type == SOCK_DGRAM &&
        ::getsockname(socket, reinterpret_cast<sockaddr*>(&address), &address_size) == 0 &&
        address.sin_family == AF_INET;
    constexpr char kDevice[] = "lo";
    if (is_of_dds &&
        ::setsockopt(socket, SOL_SOCKET, SO_BINDTODEVICE, kDevice, sizeof(kDevice)) != 0)
      return false;
  }
  return !error;
}

struct QosDeleter {
  void operator()(dds_qos_t* qos) const { dds_delete_qos(qos); }
};
using Qos = std::unique_ptr<dds_qos_t, QosDeleter>;

// A writer waits for nobody.
Qos make_qos(int kept, bool is_latched) {
  Qos qos(dds_create_qos());
  dds_qset_reliability(qos.get(), DDS_RELIABILITY_RELIABLE, 0);
  dds_qset_durability(qos.get(),
                      is_latched ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, kept);
  return qos;
}

// A sample that another one owns is read only, so the strings of constants may be lent to it.
char* lend(const std::string& text) {
  return const_cast<char*>(text.c_str());
}

std_msgs_msg_dds__Header_ header_of(const BusArm& arm) {
  const auto now = utc_ns();
  return {{static_cast<std::int32_t>(now / 1'000'000'000),
           static_cast<std::uint32_t>(now % 1'000'000'000)},
          lend(arm.frame)};
}

geometry_msgs_msg_dds__Vector3_ vector_of(const Vec3f& v) {
  return {v.x, v.y, v.z};
}

dds_sequence_double lend(double* values, std::size_t count) {
  const auto n = static_cast<std::uint32_t>(count);
  return {n, n, values, false};
}

// Hands the oldest sample that waits at a reader to `read`; false: none waits.
template <typename Message, typename Read>
bool take_one(dds_entity_t reader, Read read) {
  if (reader <= 0) return false;
  void* samples[1] = {nullptr};
  dds_sample_info_t infos[1];
  const int count = dds_take(reader, samples, infos, 1, 1);
  if (count <= 0) return false;
  if (infos[0].valid_data) read(*static_cast<const Message*>(samples[0]));
  dds_return_loan(reader, samples, count);
  return true;
}

std::string text_of(const char* text, std::size_t most) {
  return text == nullptr ? std::string() : std::string(text, ::strnlen(text, most));
}

}  // namespace

struct Bus::Topics {
  dds_entity_t measured_cp = 0, measured_cv = 0, measured_cf = 0, measured_js = 0;
  dds_entity_t jaw_measured_js = 0, operating_state = 0, warning = 0, error = 0;
  dds_entity_t servo_cp = 0, servo_cf = 0, jaw_servo_jp = 0, state_command = 0;
};

Bus::Bus() = default;

Bus::~Bus() {
  if (participant_ > 0) dds_delete(participant_);
  if (domain_ > 0) dds_delete(domain_);
}

Result<std::unique_ptr<Bus>> Bus::open(const BusSettings& settings, std::vector<BusArm> arms) {
  std::unique_ptr<Bus> bus(new Bus);
  bus->arms_ = std::move(arms);
  if (const auto created = bus->create(settings); !created) return created.error();
  return bus;
}

Status Bus::create(const BusSettings& settings) {
  const auto failed = [](const char* what, int code) {
    return Error{ErrorCode::ResourceMissing, std::string("DDS: ") + what + " (" +
                                                 dds_strretcode(code) +
                                                 "); check --interface and CYCLONEDDS_URI"};
  };
  dds_set_log_sink(pass_on, nullptr);
  domain_ = dds_create_domain(settings.domain, configuration(settings).c_str());
  if (domain_ < 0) return failed("the domain cannot be opened", domain_);
  Qos qos(dds_create_qos());
  constexpr char kEnclave[] = "enclave=/;";  // tools of ROS 2 look for it
  dds_qset_userdata(qos.get(), kEnclave, sizeof(kEnclave) - 1);
  participant_ = dds_create_participant(settings.domain, qos.get(), nullptr);
  if (participant_ < 0) return failed("no participant can be made", participant_);
  if (settings.interface.empty() && !keep_to_loopback())
    return failed("its sockets cannot be kept to this machine", DDS_RETCODE_UNSUPPORTED);
  waitset_ = dds_create_waitset(participant_);
  for (const auto& arm : arms_)
    if (const auto created = create_topics(arm); !created) return created;
  return {};
}

Status Bus::create_topics(const BusArm& arm) {
  const Qos servo = make_qos(1, false), usual = make_qos(kMostWaiting, false);
  const Qos latched = make_qos(1, true);
  int failure = 0;
  std::string failed;
  const auto note = [&](const char* name, dds_entity_t made) {
    if (made < 0 && failure == 0) failure = made, failed = arm.name + "/" + name;
    return made;
  };
  const auto topic = [&](const char* name, const dds_topic_descriptor_t& type) {
    const std::string full = "rt/" + arm.name + "/" + name;
    return note(name, dds_create_topic(participant_, &type, full.c_str(), nullptr, nullptr));
  };
  const auto writer = [&](const char* name, const dds_topic_descriptor_t& type, const Qos& qos) {
    return note(name, dds_create_writer(participant_, topic(name, type), qos.get(), nullptr));
  };
  const auto reader = [&](const char* name, const dds_topic_descriptor_t& type, const Qos& qos) {
    const auto made =
        note(name, dds_create_reader(participant_, topic(name, type), qos.get(), nullptr));
    dds_set_status_mask(made, DDS_DATA_AVAILABLE_STATUS);
    dds_waitset_attach(waitset_, made, 0);
    return made;
  };
  const auto& pose = geometry_msgs_msg_dds__PoseStamped__desc;
  const auto& twist = geometry_msgs_msg_dds__TwistStamped__desc;
  const auto& wrench = geometry_msgs_msg_dds__WrenchStamped__desc;
  const auto& joints = sensor_msgs_msg_dds__JointState__desc;
  const auto& text = std_msgs_msg_dds__String__desc;
  Topics made;
  made.measured_cp = writer("measured_cp", pose, usual);
  made.measured_cv = writer("measured_cv", twist, usual);
  made.measured_cf = writer("measured_cf", wrench, usual);
  made.measured_js = writer("measured_js", joints, usual);
  made.operating_state =
      writer("operating_state", crtk_msgs_msg_dds__OperatingState__desc, latched);
  made.warning = writer("warning", text, usual);
  made.error = writer("error", text, usual);
  made.servo_cp = reader("servo_cp", pose, servo);
  made.servo_cf = reader("servo_cf", wrench, servo);
  made.state_command = reader("state_command", crtk_msgs_msg_dds__StringStamped__desc, usual);
  if (arm.has_jaw) {
    made.jaw_measured_js = writer("jaw/measured_js", joints, usual);
    made.jaw_servo_jp = reader("jaw/servo_jp", joints, servo);
  }
  topics_.push_back(made);
  if (failure < 0)
    return Error{ErrorCode::ResourceMissing,
                 "DDS: no topic " + failed + " (" + dds_strretcode(failure) + ")"};
  return {};
}

void Bus::wait(std::uint64_t most_ns) {
  dds_attach_t triggered[1];
  dds_waitset_wait(waitset_, triggered, 1, static_cast<dds_duration_t>(most_ns));
}

std::optional<ServoPose> Bus::take_pose(std::size_t arm) {
  std::optional<ServoPose> taken;
  take_one<PoseMessage>(topics_[arm].servo_cp, [&](const PoseMessage& m) {
    const auto& p = m.pose_.position_;
    const auto& q = m.pose_.orientation_;
    taken = {text_of(m.header_.frame_id_, kMostCommandBytes),
             {p.x_, p.y_, p.z_},
             {q.x_, q.y_, q.z_, q.w_}};
  });
  return taken;
}

std::optional<ServoWrench> Bus::take_wrench(std::size_t arm) {
  std::optional<ServoWrench> taken;
  take_one<WrenchMessage>(topics_[arm].servo_cf, [&](const WrenchMessage& m) {
    const auto& f = m.wrench_.force_;
    const auto& t = m.wrench_.torque_;
    taken = {
        text_of(m.header_.frame_id_, kMostCommandBytes), {f.x_, f.y_, f.z_}, {t.x_, t.y_, t.z_}};
  });
  return taken;
}

std::optional<ServoJaw> Bus::take_jaw(std::size_t arm) {
  std::optional<ServoJaw> taken;
  take_one<JointMessage>(topics_[arm].jaw_servo_jp, [&](const JointMessage& m) {
    // Two are enough to say that one would be right.
    const auto count = std::min<std::size_t>(m.position_._length, 2);
    taken = ServoJaw{{m.position_._buffer, m.position_._buffer + count}};
  });
  return taken;
}

std::vector<std::string> Bus::take_commands(std::size_t arm) {
  std::vector<std::string> taken;
  const auto read = [&](const CommandMessage& m) {
    taken.push_back(text_of(m.string_, kMostCommandBytes));
  };
  for (int i = 0; i < kMostWaiting; ++i)
    if (!take_one<CommandMessage>(topics_[arm].state_command, read)) break;
  return taken;
}

void Bus::give(std::size_t number, const Measured& measured) {
  const auto& arm = arms_[number];
  const auto& topics = topics_[number];
  const auto header = header_of(arm);
  const auto& p = measured.tip.position;
  const auto& q = measured.tip.orientation;
  const PoseMessage pose{header, {{p.x, p.y, p.z}, {q.x, q.y, q.z, q.w}}};
  dds_write(topics.measured_cp, &pose);
  const TwistMessage twist{header,
                           {vector_of(measured.velocity_m_s), vector_of(measured.turning_rad_s)}};
  dds_write(topics.measured_cv, &twist);
  const WrenchMessage wrench{header, {vector_of(measured.force_n), vector_of(measured.torque_nm)}};
  dds_write(topics.measured_cf, &wrench);

  auto joints = measured.joints, speeds = measured.joint_speeds;
  std::vector<char*> names;
  for (const auto& name : arm.joint_names) names.push_back(lend(name));
  const auto count = static_cast<std::uint32_t>(names.size());
  const JointMessage state{header,
                           {count, count, names.data(), false},
                           lend(joints.data(), count),
                           lend(speeds.data(), count),
                           {}};
  dds_write(topics.measured_js, &state);
  if (!arm.has_jaw) return;
  static const std::string kJaw = "jaw";
  char* jaw_name = lend(kJaw);
  double jaw = measured.jaw_rad, speed = measured.jaw_speed_rad_s;
  const JointMessage jaw_state{
      header, {1, 1, &jaw_name, false}, lend(&jaw, 1), lend(&speed, 1), {}};
  dds_write(topics.jaw_measured_js, &jaw_state);
}

void Bus::give(std::size_t arm, const OperatingState& state) {
  const std::string name = name_of(state.state);
  const StateMessage message{header_of(arms_[arm]), lend(name), state.is_homed, state.is_busy};
  dds_write(topics_[arm].operating_state, &message);
}

void Bus::warn(std::size_t arm, const std::string& text) {
  const TextMessage message{lend(text)};
  dds_write(topics_[arm].warning, &message);
}

void Bus::tell_error(std::size_t arm, const std::string& text) {
  const TextMessage message{lend(text)};
  dds_write(topics_[arm].error, &message);
}

}  // namespace trocar::crtk
