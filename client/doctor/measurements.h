#pragma once

// Holds what was measured on this machine and on its way to a session, before anybody judges it.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace trocar::doctor {

// One visit to a session, as an observer who leaves again.
struct Visit {
  std::string server;           // "HOST:PORT"; empty: none was found
  std::string address;          // that the name leads to; empty: it leads nowhere
  double connect_ms = 0;        // until the server took a connection
  bool is_reached = false;      // it took one
  bool is_joined = false;       // and a frame came
  bool lacks_code = false;      // a server on another machine, and no code was given
  bool is_refused = false;      // it said no
  std::string problem;          // one line; empty: the visit was made in full
  std::string organ;            // the session's
  double seconds = 0;           // that were measured, once joined
  double round_trip_ms = 0;     // median
  double round_trip_95_ms = 0;  // 95 %
  bool has_datagrams = false;   // any came
  double lost_share = 0;        // of datagrams on the way here, 0 to 1
  double join_bytes = 0;        // until the first frame
  double join_seconds = 0;
  double bytes_per_second = 0;  // stream and datagrams, received
  double frame_bytes = 0;       // mean of what came for each frame
  double frames_per_second = 0;
  double frames_share = 0;     // of those the server made, 0 to 1
  double session_speed = 0;    // simulated seconds for each second
  double frame_age_ms = 0;     // of the least delayed twentieth of frames, by the server's clock
  double shown_later_ms = 0;   // a picture is so much behind, to level out what comes unevenly
  bool has_clock = false;      // the next two are known
  double clock_offset_ms = 0;  // the server's monotonic clock less this one's
  double clock_error_ms = 0;   // the offset is true within this, half of the shortest round trip
};

struct Graphics {
  std::string renderer;  // OpenGL's name; empty: there is no OpenGL 3.3
  std::string problem;   // one line; empty: none
  bool is_software = false;
  bool has_display = false;        // a window could be opened
  double pictures_per_second = 0;  // of the session's organ, 1280 x 720; 0: no scene to draw
};

struct Device {
  std::string name;
  bool is_real = true;  // a thing on the table, not a calculated or recorded hand
  bool is_found = false;
  std::string text;
};

struct Measurements {
  std::vector<std::string> sessions;  // that announce themselves, where none was named
  Visit visit;
  Graphics graphics;
  std::vector<Device> devices;
  std::string folder;                // where recordings and pictures would go
  std::optional<double> free_bytes;  // there; nothing: unknown
};

}  // namespace trocar::doctor
