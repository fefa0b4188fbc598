#include "tests/slicer/slicer_peer.h"

#include <gtest/gtest.h>
#include <igtlMessageHeader.h>
#include <igtlPolyDataMessage.h>
#include <igtlSensorMessage.h>
#include <igtlStatusMessage.h>
#include <igtlStringMessage.h>
#include <igtlTransformMessage.h>

#include <chrono>

namespace trocar::slicer {
namespace {

constexpr int kReceiveMs = 5000;  // a status comes every second
using Clock = std::chrono::steady_clock;

template <typename Message>
typename Message::Pointer receive_body(igtl::ClientSocket& socket, igtl::MessageHeader& header) {
  auto message = Message::New();
  message->SetMessageHeader(&header);
  message->AllocatePack();
  EXPECT_EQ(socket.Receive(message->GetPackBodyPointer(), message->GetPackBodySize()),
            message->GetPackBodySize());
  EXPECT_NE(message->Unpack(1) & igtl::MessageHeader::UNPACK_BODY, 0) << header.GetDeviceType();
  return message;
}

SeenSurface seen(igtl::PolyDataMessage& message) {
  SeenSurface surface;
  for (int i = 0; i < message.GetPoints()->GetNumberOfPoints(); ++i) {
    igtlFloat32 p[3];
    message.GetPoints()->GetPoint(static_cast<unsigned>(i), p);
    surface.points_mm.push_back({p[0], p[1], p[2]});
  }
  surface.triangles = message.GetPolygons()->GetNumberOfCells();
  auto* wound = message.GetAttribute(0);
  std::vector<igtlFloat32> values(wound->GetSize());
  wound->GetData(values.data());
  EXPECT_EQ(values.size(), surface.points_mm.size());
  for (const float value : values) surface.wounds += value != 0;
  return surface;
}

}  // namespace

SlicerPeer::SlicerPeer(int port) : socket_(igtl::ClientSocket::New()) {
  EXPECT_EQ(socket_->ConnectToServer("127.0.0.1", port), 0);
  socket_->SetReceiveTimeout(kReceiveMs);
}

bool SlicerPeer::receive_until(const std::function<bool()>& done, double seconds) {
  const auto end = Clock::now() + std::chrono::duration<double>(seconds);
  while (!done()) {
    if (Clock::now() > end || is_cut_) return false;
    is_cut_ = !receive_one();
  }
  return true;
}

bool SlicerPeer::receive_one() {
  auto header = igtl::MessageHeader::New();
  header->InitPack();
  if (socket_->Receive(header->GetPackPointer(), header->GetPackSize()) != header->GetPackSize())
    return false;
  header->Unpack();
  const std::string type = header->GetDeviceType(), device = header->GetDeviceName();
  if (type == "TRANSFORM") {
    igtl::Matrix4x4 matrix;
    receive_body<igtl::TransformMessage>(*socket_, *header)->GetMatrix(matrix);
    for (std::size_t row = 0; row < 3; ++row)
      for (std::size_t column = 0; column < 4; ++column)
        transforms[device][row][column] = matrix[row][column];
  } else if (type == "STRING") {
    texts[device] = receive_body<igtl::StringMessage>(*socket_, *header)->GetString();
  } else if (type == "STATUS") {
    const auto message = receive_body<igtl::StatusMessage>(*socket_, *header);
    statuses[device] = std::to_string(message->GetCode()) + " " + message->GetStatusString();
  } else if (type == "SENSOR") {
    const auto message = receive_body<igtl::SensorMessage>(*socket_, *header);
    sensors[device].clear();
    for (unsigned i = 0; i < message->GetLength(); ++i)
      sensors[device].push_back(message->GetValue(i));
  } else if (type == "POLYDATA") {
    surface = seen(*receive_body<igtl::PolyDataMessage>(*socket_, *header));
    ++surfaces;
  } else {
    ADD_FAILURE() << type;
    return false;
  }
  return true;
}

void SlicerPeer::send(igtl::MessageBase& message, const std::string& device) {
  message.SetDeviceName(device.c_str());
  message.Pack();
  socket_->Send(message.GetPackPointer(), message.GetPackSize());
}

void SlicerPeer::send_bytes(const std::string& bytes) {
  socket_->Send(bytes.data(), static_cast<int>(bytes.size()));
}

void SlicerPeer::send_transform(const std::string& device, const Transform& transform) {
  const auto message = igtl::TransformMessage::New();
  igtl::Matrix4x4 matrix{};
  for (std::size_t row = 0; row < 3; ++row)
    for (std::size_t column = 0; column < 4; ++column) matrix[row][column] = transform[row][column];
  matrix[3][3] = 1;
  message->SetMatrix(matrix);
  send(*message, device);
}

void SlicerPeer::send_text(const std::string& device, const std::string& text) {
  const auto message = igtl::StringMessage::New();
  message->SetEncoding(3);
  message->SetString(text.c_str());
  send(*message, device);
}

}  // namespace trocar::slicer
