#include "server/session/recording/lesson_table.h"

#include <fmt/format.h>

#include <limits>

#include "common/journal/session_journal.h"
#include "server/session/recording/csv_text.h"
#include "server/session/recording/table_file.h"
#include "server/session/replication/validation.h"

namespace trocar::recording {
namespace {

constexpr const char* kLessonHeader = "time_s,tick,what,x_m,y_m,z_m,text\n";

std::string place_text(const proto::Vec3& place) {
  return fmt::format("{:.6g},{:.6g},{:.6g}", place.x(), place.y(), place.z());
}

// Empty: it is of a newer kind.
std::string row_of(Tick recorded, const proto::LessonRecord& record) {
  const auto row = [](Tick tick, std::string_view what, std::string_view place,
                      const std::string& text) {
    return fmt::format("{:.3f},{},{},{},{}\n", static_cast<double>(tick) * 1e-3, tick, what, place,
                       text);
  };
  if (record.has_teach()) {
    const int action = record.teach().action();
    if (action < 0 || action >= replication::kTeachActions) return {};
    // Without an action it tells of a mark.
    const auto* what =
        action == 0 ? "mark" : replication::name_of(static_cast<replication::TeachAction>(action));
    return row(record.teach().tick(), what, ",,", csv_text(record.teach().text()));
  }
  if (record.has_point()) {
    const bool points = record.point().has_position_m();
    return row(recorded, points ? "point" : "point-end",
               points ? place_text(record.point().position_m()) : ",,", "");
  }
  if (record.has_view()) return row(recorded, "view", place_text(record.view().eye_m()), "");
  return {};
}

}  // namespace

Result<LessonTableCounts> write_lesson_table(const std::string& journal, const std::string& table) {
  auto session = journal::SessionJournal::open(journal);
  if (!session) return session.error();
  LessonTableCounts counts;
  TableFile out("--lesson", table);
  out.write(kLessonHeader);
  const auto read = (*session)->read_lessons(0, std::numeric_limits<Tick>::max(),
                                             [&](Tick tick, const proto::LessonRecord& record) {
                                               const auto row = row_of(tick, record);
                                               counts.left_out += record.left_out();
                                               counts.rows += row.empty() ? 0 : 1;
                                               return out.write(row);
                                             });
  // Damage is told when everything else is in the table.
  if (auto written = out.finish(); !written) return written.error();
  if (!read) return read.error();
  return counts;
}

}  // namespace trocar::recording
