#include "client/slicer/outgoing.h"

#include <igtlPolyDataMessage.h>
#include <igtlSensorMessage.h>
#include <igtlStatusMessage.h>
#include <igtlStringMessage.h>
#include <igtlTransformMessage.h>
#include <igtlUnit.h>
#include <igtl_util.h>

#include <vector>

#include "common/base/timing.h"

namespace trocar::slicer {
namespace {

constexpr std::uint64_t kNsPerSecond = 1'000'000'000;

SharedBytes packed(igtl::MessageBase& message, const std::string& device) {
  message.SetDeviceName(device.c_str());
  const auto now = utc_ns();
  message.SetTimeStamp(static_cast<unsigned>(now / kNsPerSecond),
                       igtl_nanosec_to_frac(static_cast<igtl_uint32>(now % kNsPerSecond)));
  message.Pack();
  const auto* bytes = static_cast<const std::uint8_t*>(message.GetPackPointer());
  return std::make_shared<const Bytes>(bytes, bytes + message.GetPackSize());
}

struct Code {
  int number;
  const char* name;
};
Code code_of(Condition condition) {
  using Known = igtl::StatusMessage;
  switch (condition) {
    case Condition::Fine:
      return {Known::STATUS_OK, "fine"};
    case Condition::NotReady:
      return {Known::STATUS_NOT_READY, "not ready"};
    case Condition::Busy:
      return {Known::STATUS_BUSY, "busy"};
    case Condition::Refused:
      return {Known::STATUS_CONFIG_ERROR, "refused"};
    case Condition::Over:
      break;
  }
  return {Known::STATUS_SHUT_DOWN, "over"};
}

}  // namespace

SharedBytes transform_message(const std::string& device, const Transform& transform) {
  const auto message = igtl::TransformMessage::New();
  igtl::Matrix4x4 matrix{};
  for (std::size_t row = 0; row < transform.size(); ++row)
    for (std::size_t column = 0; column < 4; ++column) matrix[row][column] = transform[row][column];
  matrix[3][3] = 1;
  message->SetMatrix(matrix);
  return packed(*message, device);
}

SharedBytes text_message(const std::string& device, const std::string& text) {
  const auto message = igtl::StringMessage::New();
  message->SetEncoding(3);  // US-ASCII
  message->SetString(text.c_str());
  return packed(*message, device);
}

SharedBytes status_message(const std::string& device, Condition condition,
                           const std::string& text) {
  const auto message = igtl::StatusMessage::New();
  const auto code = code_of(condition);
  message->SetCode(code.number);
  message->SetSubCode(0);
  message->SetErrorName(code.name);
  message->SetStatusString(text.c_str());
  return packed(*message, device);
}

SharedBytes force_message(const std::string& device, const Vec3f& ras_n) {
  const auto message = igtl::SensorMessage::New();
  const auto unit = igtl::Unit::New();
  unit->Append(igtl::Unit::SI_DERIVED_NEWTON, 1);
  message->SetLength(3);
  message->SetUnit(unit->Pack());
  message->SetValue(0, double{ras_n.x});
  message->SetValue(1, double{ras_n.y});
  message->SetValue(2, double{ras_n.z});
  return packed(*message, device);
}

SharedBytes surface_message(const std::string& device, const SurfaceView& surface) {
  const auto message = igtl::PolyDataMessage::New();
  const auto points = igtl::PolyDataPointArray::New();
  points->SetNumberOfPoints(static_cast<int>(surface.points_mm.size()));
  for (std::size_t i = 0; i < surface.points_mm.size(); ++i) {
    const auto& p = surface.points_mm[i];
    points->SetPoint(static_cast<unsigned>(i), p.x, p.y, p.z);
  }
  const auto polygons = igtl::PolyDataCellArray::New();
  std::vector<igtlFloat32> wound(surface.points_mm.size());
  for (std::size_t i = 0; i < surface.triangles.size(); ++i) {
    auto corners = surface.triangles[i];
    if (corners[0] == corners[1]) continue;
    polygons->AddCell(3, corners.data());
    const bool is_wound = i < surface.is_wound.size() && surface.is_wound[i] != 0;
    for (const auto corner : corners)
      if (is_wound) wound[corner] = 1;
  }
  // Not the triangles have it: version 1.11 of the library reads past the end of attributes of
  // cells.
  const auto attribute = igtl::PolyDataAttribute::New();
  attribute->SetType(igtl::PolyDataAttribute::POINT_SCALAR);
  attribute->SetName("wound");
  attribute->SetSize(static_cast<igtlUint32>(wound.size()));
  attribute->SetData(wound.data());
  message->SetPoints(points);
  message->SetPolygons(polygons);
  message->AddAttribute(attribute);
  return packed(*message, device);
}

}  // namespace trocar::slicer
