#include "common/wire/hand_report_messages.h"

#include <algorithm>
#include <cmath>

#include "common/base/printable.h"
#include "proto/journal.pb.h"
#include "proto/wire.pb.h"

namespace trocar::wire {
namespace {

constexpr float kForceQuantumN = 1e-4f;
constexpr std::int32_t kMostForceQuanta = 10'000'000;  // 1000 N
constexpr std::uint64_t kMostTime_us = std::uint64_t{1} << 62;
constexpr std::uint32_t kMostStep_us = 1'000'000, kMostAge_us = 60'000'000;
constexpr float kMostDelay_s = 60, kMostRate_hz = 20'000, kMostScale = 100;

Error bad(const char* field, const char* limit) {
  return {ErrorCode::BadMessage, std::string("HandReport.") + field + ": " + limit};
}

using Quanta = google::protobuf::RepeatedField<std::int32_t>;

void write(const Vec3f& force_n, Quanta& quanta) {
  for (const float part : {force_n.x, force_n.y, force_n.z}) {
    const float whole = std::round(part / kForceQuantumN);
    constexpr auto kMost = static_cast<float>(kMostForceQuanta);
    quanta.Add(std::isfinite(whole) ? static_cast<std::int32_t>(std::clamp(whole, -kMost, kMost))
                                    : 0);
  }
}
bool are_within(const Quanta& quanta) {
  return std::ranges::all_of(
      quanta, [](std::int32_t q) { return q >= -kMostForceQuanta && q <= kMostForceQuanta; });
}
Vec3f force_of(const Quanta& quanta, int moment) {
  const auto part = [&](int i) {
    return static_cast<float>(quanta[3 * moment + i]) * kForceQuantumN;
  };
  return {part(0), part(1), part(2)};
}

// False for what is not finite, too.
bool is_within(float value, float least, float most) {
  return value >= least && value <= most;
}
float brought_within(float value, float most) {
  return std::isfinite(value) ? std::clamp(value, 0.0f, most) : 0;
}

}  // namespace

void write(const HandReport& report, proto::HandReport& message) {
  message.Clear();
  message.set_tool(report.tool);
  std::uint64_t last_us = 0;
  for (const auto& moment : report.moments) {
    const auto step = std::clamp<std::uint64_t>(moment.time_us - last_us, 1, kMostStep_us);
    if (last_us == 0)
      message.set_first_time_us(moment.time_us);
    else
      message.add_later_us(static_cast<std::uint32_t>(step));
    last_us = moment.time_us;
    write(moment.hand_force_n, *message.mutable_hand_force_quanta());
    write(moment.model_force_n, *message.mutable_model_force_quanta());
    message.add_answer_age_us(std::min(moment.answer_age_us, kMostAge_us));
    message.add_limits(moment.limits);
  }
  message.set_echo_delay_s(brought_within(report.echo_delay_s, kMostDelay_s));
  message.set_rate_hz(brought_within(report.rate_hz, kMostRate_hz));
  message.set_motion_scale(brought_within(report.motion_scale, kMostScale));
  message.set_force_scale(brought_within(report.force_scale, kMostScale));
  message.set_device(printable(report.device, HandReport::kMostDeviceBytes));
}

Result<HandReport> read(const proto::HandReport& message) {
  HandReport report;
  if (message.tool() > 1) return bad("tool", "is over 1");
  report.tool = static_cast<std::uint8_t>(message.tool());
  const int moments = message.limits_size();
  if (moments < 1 || moments > static_cast<int>(HandReport::kMostMoments))
    return bad("limits", "are of no moment or of more than 8");
  if (message.later_us_size() != moments - 1 || message.answer_age_us_size() != moments ||
      message.hand_force_quanta_size() != 3 * moments ||
      message.model_force_quanta_size() != 3 * moments)
    return bad("limits", "are of another number of moments than the other fields");
  if (!are_within(message.hand_force_quanta())) return bad("hand_force_quanta", "are over 1000 N");
  if (!are_within(message.model_force_quanta()))
    return bad("model_force_quanta", "are over 1000 N");
  std::uint64_t time_us = message.first_time_us();
  if (time_us < 1 || time_us > kMostTime_us)
    return bad("first_time_us", "is not between 1 and 2^62");
  for (int i = 0; i < moments; ++i) {
    if (i > 0) {
      const auto step = message.later_us(i - 1);
      if (step < 1 || step > kMostStep_us) return bad("later_us", "is not between 1 us and 1 s");
      time_us += step;
    }
    if (message.answer_age_us(i) > kMostAge_us) return bad("answer_age_us", "is over 60 s");
    if (message.limits(i) >= 1u << kHandLimits) return bad("limits", "are over 8 bits");
    report.moments.push_back({time_us, force_of(message.hand_force_quanta(), i),
                              force_of(message.model_force_quanta(), i), message.answer_age_us(i),
                              message.limits(i)});
  }
  report.echo_delay_s = message.echo_delay_s();
  report.rate_hz = message.rate_hz();
  report.motion_scale = message.motion_scale();
  report.force_scale = message.force_scale();
  if (!is_within(report.echo_delay_s, 0, kMostDelay_s))
    return bad("echo_delay_s", "is not between 0 and 60 s");
  if (!is_within(report.rate_hz, 0, kMostRate_hz))
    return bad("rate_hz", "is not between 0 and 20 kHz");
  if (!is_within(report.motion_scale, 0, kMostScale))
    return bad("motion_scale", "is not between 0 and 100");
  if (!is_within(report.force_scale, 0, kMostScale))
    return bad("force_scale", "is not between 0 and 100");
  if (message.device().size() > HandReport::kMostDeviceBytes || !is_printable(message.device()))
    return bad("device", "is longer than 64 bytes or not printable");
  report.device = message.device();
  return report;
}

void write(const HandRecord& record, proto::HandLog& message) {
  message.set_tool(record.tool.value);
  write(record.report, *message.mutable_report());
  message.set_tick(record.tick);
  message.set_echo_time_us(record.echo_time_us);
  message.set_left_out(record.left_out);
}

Result<HandRecord> read(const proto::HandLog& message) {
  if (message.tool() >= static_cast<std::uint32_t>(kMaxTools))
    return Error{ErrorCode::BadMessage, "HandLog.tool: there is no such slot"};
  if (message.tick() > kMostTime_us || message.echo_time_us() > kMostTime_us)
    return Error{ErrorCode::BadMessage, "HandLog: tick or echo_time_us is over 2^62"};
  auto report = read(message.report());
  if (!report) return report.error();
  return HandRecord{.tool = {static_cast<std::uint8_t>(message.tool())},
                    .report = std::move(*report),
                    .tick = message.tick(),
                    .echo_time_us = message.echo_time_us(),
                    .left_out = message.left_out()};
}

}  // namespace trocar::wire
