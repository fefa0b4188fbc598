#pragma once

// Reads the surfaces of a recording frame by frame, from any tick on, without a simulation. It
// holds the messages of about a second at a time. After a gap it goes on at the next keyframe. One
// thread at a time.

#include <deque>
#include <memory>
#include <optional>

#include "common/base/result.h"
#include "common/journal/session_journal.h"
#include "common/math/vec3.h"
#include "proto/wire.pb.h"
#include "server/session/recording/stored_surface.h"

namespace trocar::recording {

struct SurfaceAt {
  Tick tick = 0;
  std::vector<float> positions_m;        // x, y, z per surface vertex
  std::vector<std::uint32_t> triangles;  // three vertices each
};

class SurfaceReader {
 public:
  // Frames with a tick in [from, to].
  SurfaceReader(std::shared_ptr<journal::SessionJournal> journal, Tick from, Tick to);

  // Nothing after the last. Error: damage, or a surface that its checksum refutes.
  Result<std::optional<SurfaceAt>> next();

 private:
  // A surface, or a change of its triangles before one.
  struct Message {
    Tick tick = 0;
    int order = 0;  // in the tick: change, key, delta
    std::optional<proto::SurfaceChange> change;
    std::optional<proto::SurfaceFrame> frame;
  };

  Status read_on();
  // Whether it shows a surface that was not shown yet.
  Result<bool> show(const Message& message);
  SurfaceAt frame_at(Tick tick) const;
  Error damaged(Tick tick, const StoredDifference& difference) const;

  const std::shared_ptr<journal::SessionJournal> journal_;
  const Tick from_, to_;
  Tick read_to_ = 0;  // messages before this tick are read
  std::deque<Message> messages_;
  StoredSurface surface_;
  std::optional<Tick> shown_;
};

}  // namespace trocar::recording
