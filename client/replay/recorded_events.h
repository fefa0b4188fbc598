#pragma once

// The time bar of a replay shows what happened in a recording: who came and went, who grasped, cut
// or was refused, what the instructor did, and where messages are missing. RecordedEvents reads the
// file once, on a thread of its own, while the recording plays. The file is outside data: what
// cannot be read is left out, and the log says so once.

#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "client/replica/session_source.h"
#include "common/base/background.h"
#include "common/base/tick.h"
#include "proto/wire.pb.h"

namespace trocar::replay {

// The log says so when a longer list is cut.
inline constexpr std::size_t kMostEvents = 4096;
inline constexpr std::size_t kForceBins = 600;  // of the whole recording

// The stage of a lesson that was on from a tick on, as people were told of it.
struct RecordedStage {
  Tick tick = 0;
  proto::LessonStage stage;
};
struct RecordedStory {
  replica::PlaybackStory story;
  std::vector<RecordedStage> stages;  // by tick

  // Returns the stage that was on at `tick`; null: none was yet.
  const RecordedStage* stage_at(Tick tick) const;
};

// Reads all of it; stops early when `is_stopping` turns true. Events are in order of ticks.
RecordedStory read_story(const std::string& path, const std::atomic<bool>& is_stopping);

class RecordedEvents {
 public:
  explicit RecordedEvents(const std::string& path);
  ~RecordedEvents() { is_stopping_.store(true); }

  // Null until the file is read.
  std::shared_ptr<const RecordedStory> story() const;

 private:
  std::atomic<bool> is_stopping_{false};
  mutable std::mutex mutex_;
  std::shared_ptr<const RecordedStory> story_;
  Background reading_;  // ends before what it writes to
};

}  // namespace trocar::replay
