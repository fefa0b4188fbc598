#pragma once

// Frames that come as datagrams: slices in any order, some twice, some never. A frame is whole when
// each of its slices has come, and right when its CRC agrees. The last 64 frames are kept, since a
// delta may start from any that was acknowledged.
//
// Outside data: what is out of range or does not fit the slices before it is dropped. Memory is
// bounded: at most 4 frames are unfinished.

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "common/base/tick.h"
#include "common/wire/blood_codec.h"
#include "common/wire/quantise.h"
#include "common/wire/surface_slices.h"

namespace trocar::proto {
class FrameState;
class FrameStatePart;
class SurfaceSlice;
}  // namespace trocar::proto

namespace trocar::replica {

// A frame says this of itself, in whichever message.
struct FrameHeader {
  Frame frame = 0;
  Tick tick = 0;
  std::uint32_t epoch = 0;
  std::uint32_t surface_crc = 0;
  bool bleeds = false;  // it has levels of blood, with this CRC
  std::uint32_t blood_crc = 0;
  std::uint64_t server_time_us = 0;  // 0: not said
  bool is_keyframe = false;
  std::size_t payload_bytes = 0;
};

class FrameAssembler {
 public:
  static constexpr std::size_t kKept = 64, kUnfinished = 4, kStates = 4;
  static constexpr std::uint32_t kMaxStateParts = 16;

  // Remembers a frame that is known to be right.
  void keep(Frame frame, const wire::QuantisedSurface& surface,
            const wire::BloodLevels& blood = {});
  struct Kept {
    Frame frame = 0;
    wire::QuantisedSurface surface;  // empty: nothing is kept here
    wire::BloodLevels blood;         // empty: the session does not bleed
  };
  // Null: it is not known, or too old.
  const Kept* find(Frame frame) const;
  // Nothing of before is of use: another surface.
  void clear();

  struct Whole {
    FrameHeader header;
    wire::QuantisedSurface surface;  // not yet compared with the CRC
    wire::BloodLevels blood;         // likewise
  };
  // `vertex_count`: of the epoch, which must be the slice's.
  std::optional<Whole> add(const proto::SurfaceSlice& slice, std::size_t vertex_count);
  // Returns the message once all of its parts are there.
  std::optional<proto::FrameState> add(const proto::FrameStatePart& part);

 private:
  struct Unfinished {
    FrameHeader header;
    Frame base = 0;
    std::uint32_t slices = 0;
    std::uint64_t present = 0;  // bit per slice
    wire::QuantisedSurface surface;
    wire::BloodLevels blood;
  };
  struct State {
    Frame frame = 0;
    std::uint32_t parts = 0, present = 0;  // bit per part
    std::array<std::string, kMaxStateParts> bytes;
  };

  Unfinished* find_or_begin(const proto::SurfaceSlice& slice, std::size_t vertex_count);

  std::array<Kept, kKept> kept_;  // by frame number
  std::deque<Unfinished> unfinished_;
  std::deque<State> states_;
};

}  // namespace trocar::replica
