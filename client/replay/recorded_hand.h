#pragma once

// A recorded hand is what one participant did with a tool in a session, and what it felt: the
// samples that the server took, and the tissue's force on the tool in each frame. The recording is
// outside data.

#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/base/tick.h"
#include "common/math/frame.h"
#include "common/tool/tool.h"

namespace trocar::replay {

struct RecordedHand {
  struct Sample {
    Tick tick;
    Pose world_from_tool;
    tool::Verb verb;
  };
  struct Felt {
    Tick tick;
    Vec3f tip_m, force_n, torque_nm;  // world frame, the torque about the tip
  };

  std::string name;
  tool::ToolShape shape;
  std::vector<Sample> samples;  // by tick, at least one
  std::vector<Felt> felt;       // by tick

  // Between the last sample before a tick and the next one; the verb is the former's.
  Sample sample_at(double tick) const;
  // Forces likewise. Nothing is felt before the first, after the last, or where more than 100 ms
  // lie between two: is_felt is false.
  struct FeltThen {
    bool is_felt = false;
    Vec3d tip_m, force_n, torque_nm;
  };
  FeltThen felt_at(double tick) const;
};

// `name`: empty if only one participant brought tools. `tool`: 0 or 1. An error says in one line
// who is in the recording, or what is wrong with it. A recording that was cut short is read to its
// end.
Result<RecordedHand> read_recorded_hand(const std::string& path, const std::string& name,
                                        std::size_t tool);

// "FILE[,name=NAME][,tool=0]"
struct HandInFile {
  std::string path, name;
  std::size_t tool = 0;
};
Result<HandInFile> parse_hand_in_file(const std::string& text);
// "NAME[,tool=0]" of a file that is known.
Result<HandInFile> parse_hand_name(const std::string& text);

}  // namespace trocar::replay
