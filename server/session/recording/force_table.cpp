#include "server/session/recording/force_table.h"

#include <fmt/format.h>

#include <array>
#include <iterator>
#include <limits>
#include <map>
#include <optional>

#include "common/journal/session_journal.h"
#include "common/wire/hand_report_messages.h"
#include "server/session/recording/csv_text.h"
#include "server/session/recording/hand_moments.h"
#include "server/session/recording/table_file.h"

namespace trocar::recording {
namespace {

constexpr Tick kAll = std::numeric_limits<Tick>::max();
constexpr const char* kHeader =
    "time_s,tick,tool,name,x_m,y_m,z_m,server_x_n,server_y_n,server_z_n,hand_x_n,hand_y_n,hand_z_n,"
    "model_x_n,model_y_n,model_z_n,limits,answer_age_s,echo_delay_s,rate_hz,motion_scale,"
    "force_scale,device\n";
constexpr const char* kNotFelt = ",,,,,,,,,,,,";

std::string names_of(std::uint32_t limits) {
  std::string names;
  for (std::size_t i = 0; i < wire::kHandLimits; ++i)
    if ((limits >> i & 1u) != 0)
      names += (names.empty() ? "" : "+") + std::string(wire::kHandLimitNames[i]);
  return names;
}

using Lists = std::map<Tick, proto::Participants>;

std::string name_at(const Lists& lists, Tick tick, std::uint32_t slot) {
  const auto next = lists.upper_bound(tick);
  if (next == lists.begin()) return {};
  for (const auto& participant : std::prev(next)->second.participant())
    if (participant.slot() == slot) return participant.name();
  return {};
}

void add_row(Tick tick, const proto::ToolState& tool, const std::string& name,
             const std::optional<FeltMoment>& felt, std::string& text) {
  const auto to = std::back_inserter(text);
  const auto& at = tool.position_m();
  const auto& force = tool.force_n();
  fmt::format_to(to, "{:.3f},{},{},{},{},{},{},{},{},{},",
                 static_cast<double>(tick) / static_cast<double>(kTicksPerSecond), tick,
                 tool.tool(), csv_text(name), at.x(), at.y(), at.z(), force.x(), force.y(),
                 force.z());
  if (felt)
    fmt::format_to(to, "{},{},{},{},{},{},{},{},{},{},{},{},{}", felt->hand_force_n.x,
                   felt->hand_force_n.y, felt->hand_force_n.z, felt->model_force_n.x,
                   felt->model_force_n.y, felt->model_force_n.z, names_of(felt->limits),
                   felt->answer_age_s, felt->echo_delay_s, felt->rate_hz, felt->motion_scale,
                   felt->force_scale, csv_text(felt->device));
  else
    text += kNotFelt;
  text += '\n';
}

}  // namespace

Result<ForceTableCounts> write_force_table(const std::string& journal, const std::string& table) {
  auto session = journal::SessionJournal::open(journal);
  if (!session) return session.error();
  ForceTableCounts counts;
  std::array<HandMoments, kMaxTools> hands;
  const auto read_hands = (*session)->read_hands(0, kAll, [&](Tick, const proto::HandLog& message) {
    const auto record = wire::read(message);
    counts.left_out += message.left_out();
    ++(record ? counts.reports : counts.refused);
    if (record) hands[record->tool.value].add(*record);
    return true;
  });
  if (!read_hands) return read_hands.error();
  Lists lists;
  const auto read_lists =
      (*session)->read_participants(0, kAll, [&](Tick tick, const proto::Participants& list) {
        lists[tick] = list;
        return true;
      });
  if (!read_lists) return read_lists.error();

  TableFile out("--forces", table);
  out.write(kHeader);
  const auto read_frames =
      (*session)->read_frame_states(0, kAll, [&](Tick tick, const proto::FrameState& state) {
        std::string rows;
        for (const auto& tool : state.tool()) {
          if (tool.tool() >= hands.size()) continue;
          const auto felt = hands[tool.tool()].at(tick);
          ++counts.rows;
          counts.felt += felt.has_value();
          add_row(tick, tool, name_at(lists, tick, tool.tool() / kToolsPerHand), felt, rows);
        }
        return out.write(rows);
      });
  // Damage is told when everything else is in the table.
  if (auto written = out.finish(); !written) return written.error();
  if (!read_frames) return read_frames.error();
  return counts;
}

}  // namespace trocar::recording
