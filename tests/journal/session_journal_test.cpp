#include "common/journal/session_journal.h"

#include "common/base/version.h"
#include "common/journal/mcap_repair.h"
#include "tests/journal/mcap_files.h"
#include "tests/journal/session_samples.h"

namespace trocar::journal {
namespace {

using namespace testing;  // NOLINT: the helpers of this folder

class session_journal : public ::testing::Test {
 protected:
  std::unique_ptr<SessionJournal> open_journal() {
    auto journal = SessionJournal::open(path_);
    EXPECT_TRUE(journal.ok()) << journal.error().message;
    return journal.ok() ? std::move(*journal) : nullptr;
  }

  TemporaryFolder folder_;
  std::string path_ = folder_.file("session.mcap");
};

TEST_F(session_journal, info_of_a_finished_session) {
  SampleSession session(path_);
  session.run(251);
  proto::JournalGap gap;
  gap.set_messages(7);
  ASSERT_TRUE(session.writer().write_gap(4000, 1, gap).ok());
  ASSERT_TRUE(session.writer().close().ok());
  auto journal = open_journal();
  ASSERT_TRUE(journal);
  const SessionInfo& info = journal->info();
  EXPECT_EQ(info.start_utc_ns, kSessionStart);
  EXPECT_EQ(info.sim_version, kSimVersion);
  EXPECT_EQ(info.protocol, std::to_string(kProtocolMajor) + "." + std::to_string(kProtocolMinor));
  EXPECT_EQ(info.organ_name, "liver");
  EXPECT_EQ(info.organ_hash, 0x0123456789abcdefu);
  EXPECT_EQ(info.last_tick, 4000u);
  EXPECT_EQ(info.gap_messages, 7u);
  EXPECT_TRUE(info.is_finished);
  EXPECT_EQ(info.summary, "finished recording: 4.0 s");
  ASSERT_EQ(info.participants.size(), 2u);
  EXPECT_EQ(info.participants[0].name(), "Mira");
  EXPECT_EQ(info.participants[1].name(), "Jonas");
  const auto& header = journal->container().header();
  EXPECT_EQ(header.profile, "trocar");
  EXPECT_EQ(header.library, std::string("trocar ") + kVersion);
  EXPECT_EQ(journal->container().metadata().at(0).entries.at("start_utc"), "2024-11-21T14:40:00Z");
  const auto organ = journal->organ();
  ASSERT_TRUE(organ.ok());
  EXPECT_EQ(organ->rest_position_m_size(), 12500);
}

TEST_F(session_journal, names_of_strangers_give_no_orders_to_a_terminal) {
  SampleSession session(path_);
  session.run(251);
  for (const Tick tick : {4016u, 4032u}) session.add_participants({"Eve\x1b[2J"}, tick);
  ASSERT_TRUE(session.writer().close().ok());
  const auto journal = open_journal();
  ASSERT_TRUE(journal);
  ASSERT_EQ(journal->info().participants.size(), 3u);
  EXPECT_EQ(journal->info().participants.back().name(), "Eve?[2J");
}

TEST_F(session_journal, a_list_that_is_small_in_the_file_and_large_in_memory_is_not_read) {
  SampleSession session(path_);
  session.run(251);
  proto::Participants list;
  for (int i = 0; i < 200'000; ++i) list.add_participant();
  ASSERT_TRUE(session.writer().write_participants(4016, kSessionStart, list).ok());
  ASSERT_TRUE(session.writer().close().ok());
  const auto journal = open_journal();
  ASSERT_TRUE(journal);
  EXPECT_EQ(journal->info().participants.size(), 2u);
  EXPECT_NE(journal->info().summary.find("message on /participants at tick 4016 is malformed"),
            std::string::npos)
      << journal->info().summary;
}

TEST_F(session_journal, every_tick_record_once_and_in_order) {
  SampleSession session(path_);
  session.run(200);
  ASSERT_TRUE(session.writer().close().ok());
  auto journal = open_journal();
  ASSERT_TRUE(journal);
  const auto ticks_in = [&](Tick from, Tick to) {
    std::vector<Tick> ticks;
    const Status status =
        journal->read_tick_records(from, to, [&](Tick, const proto::TickRecord& r) {
          EXPECT_EQ(r.state_hash(), r.tick() * 0x9e3779b97f4a7c15u);
          ticks.push_back(r.tick());
          return true;
        });
    EXPECT_TRUE(status.ok());
    return ticks;
  };
  const auto range = [](Tick from, Tick to) {
    std::vector<Tick> ticks;
    for (Tick t = from; t <= to; ++t) ticks.push_back(t);
    return ticks;
  };
  EXPECT_EQ(ticks_in(0, ~Tick{0}), range(0, 199 * 16));
  EXPECT_EQ(ticks_in(0, 0), range(0, 0));
  EXPECT_EQ(ticks_in(17, 31), range(17, 31));  // inside one batch
  EXPECT_EQ(ticks_in(1000, 1600), range(1000, 1600));
  EXPECT_EQ(ticks_in(3180, 9999), range(3180, 3184));
  EXPECT_TRUE(ticks_in(4000, 5000).empty());
}

// The surface is rebuilt as in replay: the last keyframe, then deltas. Each surface must have the
// CRC of its frame.
TEST_F(session_journal, surface_at_any_tick) {
  SampleSession session(path_);
  session.run(300);
  ASSERT_TRUE(session.writer().close().ok());
  auto journal = open_journal();
  ASSERT_TRUE(journal);
  for (const Tick tick : {0u, 15u, 16u, 991u, 992u, 993u, 2500u, 4784u, 100000u}) {
    const auto key = journal->surface_key_before(tick);
    ASSERT_TRUE(key.ok() && key->has_value()) << tick;
    const proto::SurfaceFrame& frame = **key;
    const auto view = [](const proto::SurfaceFrame& f) { return bytes_of(f.payload()); };
    wire::QuantisedSurface surface(500);
    ASSERT_TRUE(wire::decode_keyframe(view(frame), surface).ok());
    ASSERT_EQ(wire::surface_crc(surface), frame.surface_crc());
    Frame shown = frame.frame();
    const auto apply = [&](Tick, const proto::SurfaceFrame& delta) {
      EXPECT_EQ(delta.base_frame(), shown);
      EXPECT_TRUE(wire::decode_delta(view(delta), surface).ok());
      EXPECT_EQ(wire::surface_crc(surface), delta.surface_crc());
      shown = delta.frame();
      return true;
    };
    ASSERT_TRUE(journal->read_surface_deltas(frame.tick() + 1, tick, apply).ok());
    const Frame expected = std::min<Frame>(frame_of(tick), 299);
    EXPECT_EQ(shown, expected);
    EXPECT_EQ(surface, sample_surface(expected));
  }
}

TEST_F(session_journal, latest_of_each_kind) {
  SampleSession session(path_);
  session.run(250);
  ASSERT_TRUE(session.writer().close().ok());
  auto journal = open_journal();
  ASSERT_TRUE(journal);
  EXPECT_EQ((*journal->snapshot_before(1599))->tick(), 0u);
  EXPECT_EQ((*journal->snapshot_before(1600))->tick(), 1600u);
  EXPECT_EQ((*journal->snapshot_before(~Tick{0}))->tick(), 3200u);
  EXPECT_EQ((*journal->snapshot_before(1600))->state().size(), 70'000u);
  EXPECT_EQ((*journal->participants_before(799))->participant_size(), 1);
  EXPECT_EQ((*journal->participants_before(800))->participant_size(), 2);
  EXPECT_EQ((*journal->frame_state_before(100))->frame(), 6u);
  const auto topology = journal->topology_before(1000);
  ASSERT_TRUE(topology.ok());
  EXPECT_FALSE(topology->has_value());
}

TEST_F(session_journal, killed_session_loses_at_most_the_open_chunk) {
  {
    SampleSession session(path_);
    session.run(250);  // no close: as after kill -9
  }
  auto journal = open_journal();
  ASSERT_TRUE(journal);
  EXPECT_FALSE(journal->info().is_finished);
  EXPECT_GE(journal->info().last_tick, 249 * kTicksPerFrame - 250);
  EXPECT_NE(journal->info().summary.find("unfinished recording"), std::string::npos);
  EXPECT_TRUE(journal->organ().ok());
  std::uint64_t records = 0;
  ASSERT_TRUE(journal
                  ->read_tick_records(0, ~Tick{0},
                                      [&](Tick, const proto::TickRecord&) {
                                        ++records;
                                        return true;
                                      })
                  .ok());
  EXPECT_EQ(records, journal->info().last_tick + 1);
}

TEST_F(session_journal, a_repaired_one_is_whole_but_not_finished_by_its_writer) {
  {
    SampleSession session(path_);
    session.run(250);
  }
  const auto killed = load_file(path_);
  save_file(path_, BytesView(killed).first(killed.size() - 100));
  const auto repaired_path = folder_.file("repaired.mcap");
  const auto report = repair(path_, repaired_path);
  ASSERT_TRUE(report.ok()) << report.error().message;
  EXPECT_GT(report->dropped_bytes, 0u) << "the torn chunk";
  const auto before = open_journal();
  const auto after = SessionJournal::open(repaired_path);
  ASSERT_TRUE(after.ok());
  EXPECT_TRUE((*after)->container().is_finished());
  EXPECT_FALSE((*after)->info().is_finished);
  EXPECT_NE((*after)->info().summary.find("repaired"), std::string::npos);
  EXPECT_EQ((*after)->info().last_tick, before->info().last_tick);
  using Found = std::vector<std::tuple<std::string, Tick, Bytes>>;
  const auto all = [](SessionJournal& journal) {
    Found found;
    journal.read_all([&](std::string_view topic, Tick tick, BytesView bytes) {
      found.emplace_back(topic, tick, Bytes(bytes.begin(), bytes.end()));
      return true;
    });
    return found;
  };
  EXPECT_EQ(all(**after), all(*before));
  EXPECT_EQ(report->messages, all(*before).size());
  EXPECT_FALSE(repair(path_, repaired_path).ok()) << "nothing is ever overwritten";
}

TEST_F(session_journal, repair_leaves_damaged_chunks_out_and_whole_recordings_alone) {
  SampleSession session(path_);
  session.run(250);
  ASSERT_TRUE(session.writer().close().ok());
  const auto repaired_path = folder_.file("repaired.mcap");
  const auto whole = repair(path_, repaired_path);
  ASSERT_FALSE(whole.ok());
  EXPECT_NE(whole.error().message.find("nothing to repair"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(repaired_path));
  Bytes bytes = load_file(path_);
  const auto chunks = open_journal()->container().chunks();
  bytes[chunks[chunks.size() / 2].chunk_offset + 100] ^= 1;
  save_file(path_, bytes);
  const auto report = repair(path_, repaired_path);
  ASSERT_TRUE(report.ok()) << report.error().message;
  EXPECT_EQ(report->damaged_chunks, 1u);
  const auto after = SessionJournal::open(repaired_path);
  ASSERT_TRUE(after.ok());
  EXPECT_EQ((*after)->container().chunks().size(), chunks.size() - 1);
}

TEST_F(session_journal, repair_refuses_what_ends_before_its_organ_does) {
  {
    SampleSession session(path_);
    session.run(250);
  }
  const auto chunks = open_journal()->container().chunks();
  const auto bytes = load_file(path_);
  // The organ is the first message, in a chunk of its own.
  save_file(path_, BytesView(bytes).first(chunks[0].chunk_offset + chunks[0].chunk_length - 1));
  const auto repaired_path = folder_.file("repaired.mcap");
  const auto report = repair(path_, repaired_path);
  ASSERT_FALSE(report.ok());
  EXPECT_EQ(report.error().code, ErrorCode::BadFile);
  EXPECT_NE(report.error().message.find("no organ"), std::string::npos) << report.error().message;
  EXPECT_FALSE(std::filesystem::exists(repaired_path));
}

TEST_F(session_journal, damage_is_an_error_after_everything_else_was_read) {
  SampleSession session(path_);
  session.run(250);
  ASSERT_TRUE(session.writer().close().ok());
  Bytes bytes = load_file(path_);
  const auto chunks = open_journal()->container().chunks();
  bytes[chunks[chunks.size() / 2].chunk_offset + 100] ^= 1;
  save_file(path_, bytes);
  auto journal = open_journal();
  ASSERT_TRUE(journal);
  Tick last = 0;
  const Status status =
      journal->read_tick_records(0, ~Tick{0}, [&](Tick, const proto::TickRecord& r) {
        last = r.tick();
        return true;
      });
  EXPECT_FALSE(status.ok());
  EXPECT_EQ(last, 249u * 16);
}

TEST_F(session_journal, other_mcap_files_are_refused) {
  ASSERT_TRUE(create(path_)->close().ok());
  const auto journal = SessionJournal::open(path_);
  ASSERT_FALSE(journal.ok());
  EXPECT_NE(journal.error().message.find("not of a Trocar session"), std::string::npos);
}

TEST(journal_times, ticks_and_times) {
  const JournalTimes times{1000};
  EXPECT_EQ(times.log_time(0), 1000u);
  EXPECT_EQ(times.log_time(3), 3'001'000u);
  EXPECT_EQ(times.tick(3'001'000), 3u);
  EXPECT_EQ(times.tick(3'000'999), 2u);
  EXPECT_EQ(times.tick(5), 0u);
}

}  // namespace
}  // namespace trocar::journal
