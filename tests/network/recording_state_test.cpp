// Everybody in a session is told, over a real socket, when its recording has a gap or has failed,
// and who joins later is told as well.

#include <sys/resource.h>

#include <csignal>
#include <filesystem>
#include <thread>

#include "common/journal/mcap_repair.h"
#include "server/session/recording/recorder.h"
#include "server/tissue/world/surface_layout.h"
#include "tests/network/session_fixture.h"

namespace trocar::testing {
namespace {

using wire::RecordingStatus;

std::optional<proto::RecordingState> next_state(RawClient& client) {
  const auto message = client.receive(proto::Envelope::kRecordingState);
  if (!message) return std::nullopt;
  return message->recording_state();
}

class RecordingStates : public ::testing::Test {
 protected:
  RecordingStates() {
    std::filesystem::create_directories(folder_);
    auto made = recording::Recorder::create((folder_ / "session.mcap").string(), organ_,
                                            world::make_surface_layout(organ_));
    EXPECT_TRUE(made.ok());
    recorder_ = std::move(*made);
    tell();
  }
  ~RecordingStates() override {
    recorder_.reset();
    std::filesystem::remove_all(folder_);
  }

  void tell() {
    session_.on_io([&] { session_.replicator().set_recording(recorder_->state()); });
  }
  // A frame with a snapshot of so many bytes, for the recorder.
  step::SharedFrame frame_with(std::size_t bytes) {
    auto frame = std::make_shared<step::PublishedFrame>(*session_.make_frame(10));
    frame->snapshot = std::make_shared<const Bytes>(bytes);
    frame->snapshot_tick = frame->tick;
    return frame;
  }

  std::filesystem::path folder_ = std::filesystem::temp_directory_path() /
                                  ("trocar-recording-state-" + std::to_string(::getpid()));
  organ::Organ organ_ = *catalogue::make_lattice({8, 5, 8, 0.01});
  LiveSession session_;
  std::unique_ptr<recording::Recorder> recorder_;
};

TEST_F(RecordingStates, AGapIsToldToEverybodyAndToWhoJoinsLater) {
  RawClient anna(session_.port());
  ASSERT_TRUE(anna.join("Anna", proto::ROLE_SURGEON));
  auto said = next_state(anna);
  ASSERT_TRUE(said);
  EXPECT_EQ(said->status(), proto::RECORDING_WHOLE);
  EXPECT_EQ(said->text(), "");

  recorder_->record_frame(frame_with(recording::Recorder::kQueueBytes + 1));
  tell();
  said = next_state(anna);
  ASSERT_TRUE(said);
  EXPECT_EQ(said->status(), proto::RECORDING_GAPPED);
  EXPECT_EQ(said->frames_missing(), 1u);
  EXPECT_NE(said->text().find("the recording has gaps: 1 frames"), std::string::npos);

  recorder_->record_frame(frame_with(16));  // all is well again, but the gap stays
  tell();
  RawClient ben(session_.port());
  ASSERT_TRUE(ben.join("Ben", proto::ROLE_OBSERVER));
  said = next_state(ben);
  ASSERT_TRUE(said);
  EXPECT_EQ(said->status(), proto::RECORDING_GAPPED);
  EXPECT_EQ(said->frames_missing(), 1u);
}

TEST_F(RecordingStates, AFullDiskIsToldToEverybody) {
  RawClient anna(session_.port());
  ASSERT_TRUE(anna.join("Anna", proto::ROLE_SURGEON));
  ASSERT_TRUE(next_state(anna));
  // No file of this process may grow: writing fails as on a full disk.
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto old = std::signal(SIGXFSZ, SIG_IGN);
  rlimit none = before;
  none.rlim_cur = 1;
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &none), 0);
  // These bytes do not compress, so that a chunk is full and has to be written.
  std::mt19937 random(3);
  for (int i = 0; i < 40; ++i) {
    auto frame = std::make_shared<step::PublishedFrame>(*session_.make_frame(10));
    auto noise = std::make_shared<Bytes>(200'000);
    for (auto& byte : *noise) byte = static_cast<std::uint8_t>(random());
    frame->snapshot = std::move(noise);
    frame->snapshot_tick = frame->tick;
    recorder_->record_frame(frame);
  }
  const Status closed = recorder_->close();  // waits for the writer
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
  std::signal(SIGXFSZ, old);
  ASSERT_FALSE(closed.ok());
  EXPECT_EQ(recorder_->state().status, RecordingStatus::Failed);
  tell();
  const auto said = next_state(anna);
  ASSERT_TRUE(said);
  EXPECT_EQ(said->status(), proto::RECORDING_FAILED);
  EXPECT_NE(said->text().find("the recording has ended"), std::string::npos) << said->text();
}

TEST_F(RecordingStates, ARecordingThatEndsEarlyIsWhole) {
  recorder_->record_frame(frame_with(16));
  const auto path = (folder_ / "session.mcap").string();
  recorder_->end_early(path + ": the disk is nearly full");
  recorder_->end_early("another reason");
  while (recorder_->state().status != RecordingStatus::Failed) std::this_thread::yield();
  EXPECT_EQ(recorder_->state().text,
            "the recording has ended: " + path + ": the disk is nearly full");
  const auto bytes = std::filesystem::file_size(path);
  recorder_->record_frame(frame_with(16));  // too late
  EXPECT_FALSE(recorder_->close().ok());
  EXPECT_EQ(std::filesystem::file_size(path), bytes);
  const auto again = journal::repair(path, (folder_ / "again.mcap").string());
  ASSERT_FALSE(again.ok());
  EXPECT_EQ(again.error().code, ErrorCode::Usage) << "nothing is to be repaired";
}

}  // namespace
}  // namespace trocar::testing
