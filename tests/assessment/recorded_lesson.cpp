#include "tests/assessment/recorded_lesson.h"

#include <gtest/gtest.h>

#include "common/base/bytes.h"
#include "server/organs/catalogue/builtin_organs.h"
#include "server/session/recording/recorder.h"
#include "server/tissue/step/simulation.h"

namespace trocar::assessment::testing {

void record(const std::string& path, const Session& session, const Play& play) {
  step::Simulation simulation(*catalogue::make_liver(800));
  auto recorder = recording::Recorder::create(path, simulation.organ(), simulation.layout());
  ASSERT_TRUE(recorder.ok()) << recorder.error().message;
  std::vector<participants::Participant> present;
  for (std::uint8_t slot = 0; slot < session.names.size(); ++slot)
    present.push_back({{slot}, session.names[slot], participants::Role::Surgeon, {{}}});
  (*recorder)->record_participants(present, 0);
  const auto write = [&](const proto::LessonRecord& record) {
    const std::string text = record.SerializeAsString();
    const auto bytes = bytes_of(std::string_view(text));
    (*recorder)->record_lesson({.message = Bytes(bytes.begin(), bytes.end())});
  };
  proto::LessonRecord record;
  if (!session.lesson.empty()) {
    record.mutable_lesson()->set_source(session.lesson);
    write(record);
  }
  for (const auto& input : session.inputs) {
    *record.mutable_input() = input;
    write(record);
  }
  for (const auto& stage : session.told) {
    *record.mutable_stage() = stage;
    write(record);
  }
  const auto frames = static_cast<Frame>(session.seconds * 62.5);
  for (Frame frame = 1; frame <= frames; ++frame) {
    auto published = std::make_shared<step::PublishedFrame>();
    published->frame = frame;
    published->tick = frame * kTicksPerFrame;
    published->surface.resize(simulation.layout().vertex_count());
    published->surface_crc = wire::surface_crc(published->surface);
    play(*published);
    (*recorder)->record_frame(published);
  }
  const Status closed = (*recorder)->close();
  ASSERT_TRUE(closed.ok()) << closed.error().message;
}

step::ToolFrame tool_at(ToolSlot tool, const Vec3f& tip_m, const Vec3f& force_n, tool::Verb verb,
                        bool has_claim) {
  step::ToolFrame frame;
  frame.tool = tool;
  frame.world_from_tool.position = frame.world_from_proxy.position = tip_m;
  frame.force_n = force_n;
  frame.verb = verb;
  frame.has_claim = has_claim;
  return frame;
}

hands::ClaimEvent claim(Tick tick, ToolSlot tool, tool::Verb verb, wire::ClaimOutcome outcome) {
  hands::ClaimEvent event;
  event.tick = tick, event.tool = tool, event.verb = verb, event.outcome = outcome;
  return event;
}

}  // namespace trocar::assessment::testing
