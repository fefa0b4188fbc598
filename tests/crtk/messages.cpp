#include "tests/crtk/messages.h"

#include <fastcdr/Cdr.h>

namespace trocar::crtk {
namespace {

using eprosima::fastcdr::Cdr;
using eprosima::fastcdr::FastBuffer;

template <typename Fill>
Sample written(const std::string& frame, Fill fill) {
  FastBuffer buffer;
  Cdr cdr(buffer, Cdr::LITTLE_ENDIANNESS, Cdr::DDS_CDR);
  cdr.serialize_encapsulation();
  cdr << std::int32_t{1} << std::uint32_t{2} << frame;
  fill(cdr);
  const auto* begin = reinterpret_cast<const std::uint8_t*>(buffer.getBuffer());
  return {begin, begin + cdr.getSerializedDataLength()};
}

// Returns the frame.
template <typename Take>
std::string read(const Sample& bytes, Take take, bool has_header = true) {
  std::string frame;
  if (bytes.empty()) return frame;
  auto copy = bytes;
  FastBuffer buffer(reinterpret_cast<char*>(copy.data()), copy.size());
  Cdr cdr(buffer, Cdr::LITTLE_ENDIANNESS, Cdr::DDS_CDR);
  cdr.read_encapsulation();
  std::int32_t seconds = 0;
  std::uint32_t nanoseconds = 0;
  if (has_header) cdr >> seconds >> nanoseconds >> frame;
  take(cdr);
  return frame;
}

}  // namespace

Sample write(const PoseSample& sample) {
  return written(sample.frame, [&](Cdr& cdr) { cdr << sample.position << sample.orientation; });
}

Sample write(const WrenchSample& sample) {
  return written(sample.frame, [&](Cdr& cdr) { cdr << sample.force << sample.torque; });
}

Sample write(const JointSample& sample) {
  return written("", [&](Cdr& cdr) {
    cdr << sample.name << sample.position << sample.velocity << sample.effort;
  });
}

Sample write_command(const std::string& command) {
  return written("", [&](Cdr& cdr) { cdr << command; });
}

PoseSample read_pose(const Sample& bytes) {
  PoseSample sample;
  sample.frame = read(bytes, [&](Cdr& cdr) { cdr >> sample.position >> sample.orientation; });
  return sample;
}

WrenchSample read_wrench(const Sample& bytes) {
  WrenchSample sample;
  sample.frame = read(bytes, [&](Cdr& cdr) { cdr >> sample.force >> sample.torque; });
  return sample;
}

JointSample read_joints(const Sample& bytes) {
  JointSample sample;
  read(bytes, [&](Cdr& cdr) {
    cdr >> sample.name >> sample.position >> sample.velocity >> sample.effort;
  });
  return sample;
}

StateSample read_state(const Sample& bytes) {
  StateSample sample;
  read(bytes, [&](Cdr& cdr) { cdr >> sample.state >> sample.is_homed >> sample.is_busy; });
  return sample;
}

std::string read_text(const Sample& bytes) {
  std::string text;
  read(
      bytes, [&](Cdr& cdr) { cdr >> text; }, false);
  return text;
}

}  // namespace trocar::crtk
