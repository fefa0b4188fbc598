#include "server/session/replication/hands.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/wire/tool_shape.h"
#include "proto/wire.pb.h"

namespace trocar::replication {

std::optional<Ending> Hands::sample(Speaker& who, const proto::ToolSample& sample,
                                    bool is_ordered) {
  const auto& participant = *who.participant;
  if (!participant.slot.has_tools())
    return Ending{EndReason::Role,
                  "ToolSample: " + wire::one_of(participant.role) + " watches and has no tools"};
  const auto checked = check_tool_sample(sample, participant.tools.size());
  if (!checked) return Ending{EndReason::ProtocolError, checked.error().message};
  auto& last = who.last_sequence[static_cast<std::size_t>(checked->tool)];
  if (last && checked->sequence <= *last && !is_ordered) return std::nullopt;  // seen, or too late
  if (last && checked->sequence <= *last)
    return Ending{EndReason::ProtocolError,
                  "ToolSample.sequence: " + std::to_string(checked->sequence) + " after " +
                      std::to_string(*last) + ", it must grow"};
  last = checked->sequence;
  ++counters_.samples;
  const hands::ToolInput wanted{tool_slot(participant.slot, checked->tool), checked->sample,
                                checked->client_time_us};
  const bool was_lent = held_.is_lent(wanted.tool);
  if (const auto given = held_.apply(wanted, session_.now_ns())) session_.inbox.push_sample(*given);
  if (was_lent && !held_.is_lent(wanted.tool)) note_loan(wanted.tool);
  return std::nullopt;
}

std::optional<Ending> Hands::report(Speaker& who, const proto::HandReport& message) {
  const auto& participant = *who.participant;
  if (!participant.slot.has_tools())
    return Ending{EndReason::Role,
                  "HandReport: " + wire::one_of(participant.role) + " watches and has no hands"};
  auto report = check_hand_report(message, participant.tools.size());
  if (!report) return Ending{EndReason::ProtocolError, report.error().message};
  const auto moments = static_cast<double>(report->moments.size());
  if (!who.hand_moments.take(moments, session_.now_ns())) {
    ++counters_.floods;
    return Ending{EndReason::ProtocolError,
                  "HandReport: more than " +
                      std::to_string(session_.options.max_hand_moments_per_second) +
                      " moments in a second: send one per frame"};
  }
  ++counters_.hand_reports;
  if (!session_.options.on_hand_report) return std::nullopt;
  wire::HandRecord record{.tool = tool_slot(participant.slot, report->tool),
                          .report = std::move(*report)};
  if (const auto& frame = session_.audience.newest_frame()) {
    record.tick = frame->tick;
    const auto shown = std::ranges::find(frame->tools, record.tool, &step::ToolFrame::tool);
    if (shown != frame->tools.end()) record.echo_time_us = shown->touch.echo_time_us;
  }
  session_.options.on_hand_report(std::move(record));
  return std::nullopt;
}

// Whoever may not have what was asked for is told, as everybody is, what the tool is.
std::optional<Ending> Hands::change_tool(Speaker& who, const proto::ToolChange& change) {
  auto& participant = *who.participant;
  if (!participant.slot.has_tools())
    return Ending{EndReason::Role,
                  "ToolChange: " + wire::one_of(participant.role) + " watches and has no tools"};
  const auto number = static_cast<std::size_t>(change.tool());
  if (number >= participant.tools.size())
    return Ending{EndReason::ProtocolError, "ToolChange.tool: " + std::to_string(number) +
                                                ", you have " +
                                                std::to_string(participant.tools.size())};
  const auto shape = wire::read(change.shape());
  if (!tool::is_valid(shape))
    return Ending{EndReason::ProtocolError, "ToolChange.shape: there is no such tool"};
  const auto slot = tool_slot(participant.slot, static_cast<int>(number));
  session_.has_changed = true;
  if (!who.changes.take(1, session_.now_ns())) return std::nullopt;
  auto refused = std::exchange(participant.tools[number], shape);
  if (session_.roster.change_tool(participant.slot, number, shape) &&
      session_.inbox.try_push_change({slot, shape}))
    return std::nullopt;
  participant.tools[number] = refused;
  (void)session_.roster.change_tool(participant.slot, number, refused);
  return std::nullopt;
}

void Hands::open(ParticipantSlot slot) {
  for (const auto& input : held_.open(slot)) {
    session_.inbox.push_sample(input);
    note_loan(input.tool);
  }
}

std::string Hands::hand_over(const hands::Handover& handover) {
  const auto [from, to] = handover;
  if (!session_.inbox.try_push_handover(handover))
    return "not done: too much is under way, ask again";
  held_.hand_over(handover);
  const auto shape_of = [this](ToolSlot tool) {
    return session_.roster.find(tool.owner())->tools[static_cast<std::size_t>(tool.number())];
  };
  const auto given = shape_of(from), taken = shape_of(to);
  for (const auto& [tool, shape] : {std::pair{from, taken}, std::pair{to, given}}) {
    (void)session_.roster.change_tool(tool.owner(), tool.number(), shape);
    if (auto* who = session_.audience.find(tool.owner()))
      who->participant->tools[static_cast<std::size_t>(tool.number())] = shape;
  }
  for (const auto tool : {from, to}) note_loan(tool);
  return {};
}

void Hands::note_loan(ToolSlot tool) {
  session_.roster.set_lent(tool, held_.is_lent(tool));
  session_.has_changed = true;
}

}  // namespace trocar::replication
