#pragma once

// Recordings of hands whose motion and forces are known, without a simulation behind them.

#include <functional>
#include <string>
#include <vector>

#include "common/math/vec3.h"
#include "common/tool/tool.h"
#include "common/wire/claim_outcome.h"
#include "proto/journal.pb.h"
#include "server/tissue/step/published_frame.h"

namespace trocar::assessment::testing {

// Fills in the tools and claim events of the frame of a tick.
using Play = std::function<void(step::PublishedFrame& frame)>;

struct Session {
  double seconds = 4;
  std::vector<std::string> names{"Anna"};  // of slots 0, 1, ...
  std::string lesson;                      // TOML; empty: none
  std::vector<proto::LessonInput> inputs;
  std::vector<proto::LessonStage> told;
};
void record(const std::string& path, const Session& session, const Play& play);

step::ToolFrame tool_at(ToolSlot tool, const Vec3f& tip_m, const Vec3f& force_n = {},
                        tool::Verb verb = tool::Verb::None, bool has_claim = false);
hands::ClaimEvent claim(Tick tick, ToolSlot tool, tool::Verb verb, wire::ClaimOutcome outcome);

// Follow the point at (0, 0.2, 0), which hardly moves, for one second with the tip within 10 mm.
inline constexpr const char* kFollowLesson = R"(
title = "Follow"
text = "Follow the point."
organ = "liver"
[[stage]]
name = "First"
text = "Keep the tip on it."
goal = "follow"
line_mm = [[0, 200, 0], [0, 200, 1]]
lap_s = 100
tolerance_mm = 10
hold_s = 1
limit_s = 60
force_limit_n = 1
[[stage.score]]
measure = "peak_force_n"
full = 1
none = 3
[[stage]]
name = "Second"
text = "Again."
goal = "follow"
line_mm = [[0, 200, 0], [0, 200, 1]]
lap_s = 100
tolerance_mm = 10
hold_s = 1
limit_s = 60
)";

}  // namespace trocar::assessment::testing
