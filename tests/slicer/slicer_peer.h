#pragma once

// A peer as 3D Slicer is one: OpenIGTLink's own client, and what it has received last.

#include <igtlClientSocket.h>
#include <igtlMessageBase.h>

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "client/slicer/frames.h"

namespace trocar::slicer {

struct SeenSurface {
  std::vector<Vec3f> points_mm;
  std::size_t triangles = 0, wounds = 0;
};

class SlicerPeer {
 public:
  explicit SlicerPeer(int port);

  // Takes what comes until `done` or the time is over; returns whether it was done.
  bool receive_until(const std::function<bool()>& done, double seconds = 20);
  void send(igtl::MessageBase& message, const std::string& device);
  void send_bytes(const std::string& bytes);
  void send_transform(const std::string& device, const Transform& transform);
  void send_text(const std::string& device, const std::string& text);
  void leave() { socket_->CloseSocket(); }
  // The other side has closed the connection.
  bool is_cut() const { return is_cut_; }

  std::map<std::string, Transform> transforms;
  std::map<std::string, std::string> texts, statuses;
  std::map<std::string, std::vector<double>> sensors;
  SeenSurface surface;
  int surfaces = 0;

 private:
  bool receive_one();

  igtl::ClientSocket::Pointer socket_;
  bool is_cut_ = false;
};

}  // namespace trocar::slicer
