#include "tests/recording/continued_session.h"

#include <gtest/gtest.h>

#include <memory>
#include <utility>
#include <vector>

#include "common/base/bytes.h"
#include "common/journal/session_journal.h"
#include "server/session/recording/recorded_session.h"
#include "server/session/recording/recorder.h"
#include "server/session/recording/resume.h"
#include "tests/support/files.h"

namespace trocar::recording::testing {

void cut_off(const std::string& whole, double share, const std::string& part) {
  const auto bytes = trocar::testing::load_file(whole);
  trocar::testing::save_file(
      part,
      BytesView(bytes).first(static_cast<std::size_t>(share * static_cast<double>(bytes.size()))));
}

namespace {

void go_on_with(const std::string& part, const std::string& whole, const std::string& next,
                Tick until, bool has_people) {
  auto session = resume_session(part, {});
  ASSERT_TRUE(session.ok()) << session.error().message;
  auto& simulation = session->simulation;
  Beginning beginning;
  beginning.continues = session->continuation;
  beginning.bleeding = simulation.rules().bleeding;
  auto recorder = Recorder::create(next, simulation.organ(), simulation.layout(), beginning);
  ASSERT_TRUE(recorder.ok()) << recorder.error().message;
  hands::TickInputs leaves;
  for (const auto& who : session->participants) leaves.leaves.push_back(who.slot);
  if (has_people) (*recorder)->record_participants(session->participants, 0);
  Bytes state;
  simulation.write_snapshot(state);
  auto snapshot = std::make_shared<const Bytes>(std::move(state));
  auto journal = journal::SessionJournal::open(whole);
  ASSERT_TRUE(journal.ok());
  std::vector<step::TickRecord> records;
  const auto read = read_ticks(**journal, [&](const step::TickRecord& record, bool& stop) {
    stop = record.tick >= until;
    if (record.tick <= simulation.current_tick()) return Status();
    const auto& inputs = has_people ? record.inputs : leaves;
    const auto& done = simulation.tick(inputs, record.decisions);
    if (has_people) {
      EXPECT_EQ(done.state_hash, record.state_hash);
    }
    records.push_back({done.tick, record.decisions, inputs, done.state_hash});
    leaves.clear();
    auto frame = simulation.pop_frame();
    if (!frame) return Status();
    frame->records = std::exchange(records, {});
    frame->snapshot = std::exchange(snapshot, nullptr);
    frame->snapshot_tick = session->continuation.tick;
    (*recorder)->record_frame(frame);
    return Status();
  });
  EXPECT_TRUE(read.ok()) << read.error().message;
  ASSERT_TRUE((*recorder)->close().ok());
}

}  // namespace

void go_on(const std::string& part, const std::string& whole, const std::string& next, Tick until) {
  go_on_with(part, whole, next, until, true);
}

void go_on_alone(const std::string& part, const std::string& whole, const std::string& next,
                 Tick until) {
  go_on_with(part, whole, next, until, false);
}

}  // namespace trocar::recording::testing
