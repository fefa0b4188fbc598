#pragma once

// A client says two things: a reading of one of its tools, and a person's wish. What hands feel is
// read here, too.

#include "client/replica/hand_line.h"
#include "client/replica/session_source.h"
#include "common/base/ids.h"
#include "common/tool/tool.h"

namespace trocar::replica {

// `tool` is 0 or 1; `sequence` counts up per client. False if the source dropped it.
bool send_tool_sample(SessionSource& source, std::uint32_t tool, std::uint32_t sequence,
                      const tool::ToolSample& sample);
// To take another instrument. False if the source dropped it.
bool send_tool_change(SessionSource& source, std::uint32_t tool, const tool::ToolShape& shape);
// The message of a reading, of a hand that feels.
void write_reading(const HandLineReading& reading, std::uint32_t sequence,
                   proto::Envelope& envelope);

void write_report(const wire::HandReport& report, proto::Envelope& envelope);

// Hands on what a server says to hands that feel, if the message does. What is not as it may be is
// left out; returns how many such parts there were.
std::uint32_t pass_on(const proto::Envelope& message, HandLine& hands);

// To mark the organ as it is, or to return it to the mark; `name`: of several marks. False if the
// source dropped it.
bool ask_for_mark(SessionSource& source, bool is_return, const std::string& name = {});
// An instructor does this with the session, or with a participant's tools. The values are those of
// proto::TeachAction.
enum class LeadAction : std::uint8_t {
  Freeze = 1,
  Release = 2,
  TakeClaim = 3,
  End = 9,
  Pause = 15,
  GoOn = 16,
  Slow = 17,
  HandOver = 18,
};
struct LeadWish {
  LeadAction action = LeadAction::Pause;
  ParticipantSlot participant;  // whose tools; with the name that others read
  std::string name;
  float rate = 0;  // of Slow
  // HandOver gives this tool to this participant.
  int tool = 0;
  ParticipantSlot receiver;
  std::string receiver_name;
};
bool send_lead_wish(SessionSource& source, const LeadWish& wish);
// To say something in a lesson, as a hand or an instructor. False if the source dropped it.
enum class LessonWish : std::uint8_t { Answer = 1, Next = 2, Restart = 3 };
bool send_lesson_wish(SessionSource& source, LessonWish wish, std::uint32_t tool = 0);
// To say where one's own view is, as who has the view to follow. False if the source dropped it.
bool send_view(SessionSource& source, const Vec3f& eye_m, const Vec3f& target_m);

}  // namespace trocar::replica
