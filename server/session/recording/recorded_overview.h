#pragma once

// Makes the overviews of a recording anew from its other messages, as the recorder makes them from
// frames: for recordings that were put together of others, or cut out of them. Messages come in the
// order in which they were recorded. One thread.

#include <optional>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/journal/session_topics.h"
#include "server/session/recording/overview.h"

namespace trocar::recording {

class RecordedOverview {
 public:
  // begin: the tick after which the recording begins.
  explicit RecordedOverview(Tick begin) : builder_(begin) {}

  // Returns the overview to write behind this message, if one is full. Error: it is no message of
  // its kind.
  Result<std::optional<proto::Overview>> take(journal::JournalTopic topic, Tick tick,
                                              BytesView bytes);
  // Returns the rest, at the end.
  std::optional<proto::Overview> rest();

 private:
  std::optional<proto::Overview> take_gap(const proto::JournalGap& gap);
  std::optional<proto::Overview> take_frame(const proto::FrameState& state);
  void take_lesson(Tick tick, const proto::LessonRecord& record);

  OverviewBuilder builder_;
  bool expects_key_ = true;   // the next surface needs none before it
  Tick last_delta_tick_ = 0;  // a keyframe without a delta of its tick replaces the surface
};

}  // namespace trocar::recording
