#include "server/app/server/journal_sink.h"

#include <ctime>

#include "server/session/recording/recorder.h"

namespace trocar::app {
namespace {

class RecordedSession : public JournalSink {
 public:
  explicit RecordedSession(std::unique_ptr<recording::Recorder> recorder)
      : recorder_(std::move(recorder)) {}

  void record_frame(const step::SharedFrame& frame) override { recorder_->record_frame(frame); }
  void record_participants(const std::vector<participants::Participant>& present,
                           Tick tick) override {
    recorder_->record_participants(present, tick);
  }
  void record_hand(wire::HandRecord record) override { recorder_->record_hand(std::move(record)); }
  void record_lesson(wire::LessonEntry entry) override {
    recorder_->record_lesson(std::move(entry));
  }
  void end_early(const std::string& reason) override { recorder_->end_early(reason); }
  std::size_t queued_bytes() const override { return recorder_->queued_bytes(); }
  std::uint64_t sync_count() const override { return recorder_->sync_count(); }
  Status close() override { return recorder_->close(); }
  wire::RecordingState state() const override { return recorder_->state(); }

 private:
  std::unique_ptr<recording::Recorder> recorder_;
};

}  // namespace

Result<std::unique_ptr<JournalSink>> open_journal(
    const std::string& path, const organ::Organ& organ, const wire::SurfaceLayout& layout,
    const std::optional<journal::Continuation>& continues, const step::SceneRules& rules,
    const std::optional<secure::SigningKey>& key) {
  if (path == "none") return std::unique_ptr<JournalSink>();
  recording::Beginning beginning;
  beginning.continues = continues;
  beginning.bleeding = rules.bleeding;
  beginning.threads = rules.threads;
  beginning.key = key;
  auto recorder = recording::Recorder::create(path, organ, layout, beginning);
  if (!recorder) return recorder.error();
  return std::unique_ptr<JournalSink>(std::make_unique<RecordedSession>(std::move(*recorder)));
}

std::string default_journal_path() {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  char text[64];
  std::strftime(text, sizeof text, "./trocar-%Y%m%dT%H%M%SZ.mcap", &utc);
  return text;
}

}  // namespace trocar::app
