// The replicator's part about what hands do: samples, instruments, what was felt.

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/wire/tool_shape.h"
#include "proto/wire.pb.h"
#include "server/session/replication/messages.h"
#include "server/session/replication/replicator_client.h"
#include "server/session/replication/validation.h"

namespace trocar::replication {

std::optional<Replicator::Ending> Replicator::handle_sample(Client& client,
                                                            const proto::ToolSample& sample,
                                                            bool is_ordered) {
  const auto& participant = *client.participant;
  if (!participant.slot.has_tools())
    return Ending{EndReason::Role,
                  "ToolSample: " + wire::one_of(participant.role) + " watches and has no tools"};
  const auto checked = check_tool_sample(sample, participant.tools.size());
  if (!checked) return Ending{EndReason::ProtocolError, checked.error().message};
  auto& last = client.last_sequence[static_cast<std::size_t>(checked->tool)];
  if (last && checked->sequence <= *last && !is_ordered) return std::nullopt;  // seen, or too late
  if (last && checked->sequence <= *last)
    return Ending{EndReason::ProtocolError,
                  "ToolSample.sequence: " + std::to_string(checked->sequence) + " after " +
                      std::to_string(*last) + ", it must grow"};
  last = checked->sequence;
  ++counters_.samples;
  const hands::ToolInput wanted{tool_slot(participant.slot, checked->tool), checked->sample,
                                checked->client_time_us};
  const bool was_lent = held_tools_.is_lent(wanted.tool);
  if (const auto given = held_tools_.apply(wanted, options_.clock_ns())) inbox_.push_sample(*given);
  if (was_lent && !held_tools_.is_lent(wanted.tool)) note_loan(wanted.tool);
  return std::nullopt;
}

std::optional<Replicator::Ending> Replicator::handle_hand_report(Client& client,
                                                                 const proto::HandReport& message) {
  const auto& participant = *client.participant;
  if (!participant.slot.has_tools())
    return Ending{EndReason::Role,
                  "HandReport: " + wire::one_of(participant.role) + " watches and has no hands"};
  auto report = check_hand_report(message, participant.tools.size());
  if (!report) return Ending{EndReason::ProtocolError, report.error().message};
  const auto moments = static_cast<double>(report->moments.size());
  if (!client.hand_moments.take(moments, options_.clock_ns())) {
    ++counters_.floods;
    return Ending{EndReason::ProtocolError,
                  "HandReport: more than " + std::to_string(options_.max_hand_moments_per_second) +
                      " moments in a second: send one per frame"};
  }
  ++counters_.hand_reports;
  if (!options_.on_hand_report) return std::nullopt;
  wire::HandRecord record{.tool = tool_slot(participant.slot, report->tool),
                          .report = std::move(*report)};
  if (const auto& frame = encoder_.current()) {
    record.tick = frame->tick;
    const auto shown = std::ranges::find(frame->tools, record.tool, &step::ToolFrame::tool);
    if (shown != frame->tools.end()) record.echo_time_us = shown->touch.echo_time_us;
  }
  options_.on_hand_report(std::move(record));
  return std::nullopt;
}

// Whoever may not have what was asked for is told, as everybody is, what the tool is.
std::optional<Replicator::Ending> Replicator::handle_tool_change(Client& client,
                                                                 const proto::ToolChange& change) {
  auto& participant = *client.participant;
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
  participants_changed_ = true;
  if (!client.changes.take(1, options_.clock_ns())) return std::nullopt;
  auto refused = std::exchange(participant.tools[number], shape);
  if (roster_.change_tool(participant.slot, number, shape) && inbox_.try_push_change({slot, shape}))
    return std::nullopt;
  participant.tools[number] = refused;
  (void)roster_.change_tool(participant.slot, number, refused);
  return std::nullopt;
}

}  // namespace trocar::replication
