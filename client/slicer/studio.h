#pragma once

// Organs of what peers send, made by trocar-organ, and sessions of these, held by trocar-server.
//
//   IMAGE     -> NAME-1.nii, or a file        --> trocar-organ import ... --> NAME-1.organ
//   POLYDATA  -> NAME-1.obj, its fine surface  -> ... --embed
//   NAME-1.organ --> trocar-server --organ
//
// Both programs are processes of their own. Reading, checking and writing what a peer sent is the
// work of a thread. One thing is made at a time, and until it is done another is refused. A fine
// surface waits for the label map it belongs to; after one, the organ is made again. Each file has
// a name that was free. Where sessions are wanted, the next organ ends the session of the one
// before, which is waited for. Thread: one.

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "client/slicer/peers.h"
#include "common/base/background.h"
#include "common/process/memory_file.h"
#include "common/process/process.h"

namespace trocar::slicer {

struct StudioOptions {
  std::filesystem::path folder;  // empty: nothing is taken
  int nodes = 2000;
  std::string labels;                         // as trocar-organ import has them; empty: all
  bool serves = false;                        // else it says how to
  std::string listen = "127.0.0.1:7690";      // of the server
  bool is_insecure = false, records = false;  // likewise
};

struct StudioEvents {
  std::function<void(const std::string& text)> said;  // how far it is
  std::function<void(PeerId peer, const Error& error)> failed;
  // The organ's centre in its scan, in the world's axes.
  std::function<void(const std::filesystem::path& organ, const Vec3d& offset_m)> made;
  std::function<void(std::uint16_t port)> serving;
  std::function<void(const std::string& why)> stopped;  // its server, which nobody has asked to
};

inline constexpr int kMostTaken = 100;  // label maps and surfaces, so that they fill no disk

class Studio {
 public:
  Studio(StudioOptions options, StudioEvents events);
  ~Studio();

  // A label map or a surface. Error: nothing is taken, or something else is being made.
  Status take(PeerMessage message);
  // A file that trocar-organ reads.
  Status take_file(const std::filesystem::path& label_map);
  bool is_busy() const { return stage_ != Stage::Idle; }
  void poll();
  // Asks the server to end, and waits for that.
  void end_session();

 private:
  enum class Stage { Idle, Reading, Importing, Inspecting, Starting };

  Status begin_import();
  Status begin_inspection();
  Status begin_session();
  void finish_reading();
  void finish_import();
  void finish_inspection();
  void look_for_port();
  void watch_server();
  Status start(std::vector<std::string> words);
  void fail(const Error& error);
  std::filesystem::path free_stem(const std::string& device) const;

  const StudioOptions options_;
  const StudioEvents events_;
  Stage stage_ = Stage::Idle;
  PeerId for_peer_ = 0;  // whom errors are told; 0: nobody
  Background reading_;
  Result<std::filesystem::path> read_{std::filesystem::path()};  // what it has written
  bool reads_surface_ = false;
  std::filesystem::path label_map_, surface_, organ_;  // empty: none
  bool waits_ = false;  // the surface, for an organ to be made with it
  std::optional<process::Child> child_, server_;
  std::optional<process::MemoryFile> said_, complained_;  // by the child
  std::filesystem::path ready_file_;
  int taken_ = 0;
};

}  // namespace trocar::slicer
