#pragma once

// One published frame becomes these messages in a journal: the recorder writes these messages, and
// verification builds them again from a second simulation and compares.
//
// The order is: tick batch, surface change, surface delta, topology, keyframe, claims, one state
// per tool, frame state. A delta refers to the surface before; there is none after skip() and where
// the surface was replaced, and a keyframe follows there. One thread.

#include <memory>
#include <span>
#include <string>

#include "common/journal/session_topics.h"
#include "common/wire/surface_layout.h"
#include "server/session/participants/roster.h"
#include "server/tissue/step/published_frame.h"

namespace google::protobuf {
class Message;
}
namespace trocar::proto {
class ToolState;
}

namespace trocar::recording {

class MessageSink {
 public:
  virtual ~MessageSink() = default;
  virtual Status write(journal::JournalTopic topic, const google::protobuf::Message& message) = 0;
  virtual Status write(const proto::ToolState& tool) = 0;
};

class FrameMessages {
 public:
  FrameMessages(std::string organ_name, wire::SurfaceLayout layout)
      : organ_name_(std::move(organ_name)), layout_(std::move(layout)) {}

  // Frames were left out. They gave the surface another layout (null: they did not), and then these
  // changes.
  Status skip(const wire::SurfaceLayout* new_layout,
              std::span<const std::shared_ptr<const wire::SurfaceChange>> changes);

  // roster: names for claim events.
  Status write(const step::PublishedFrame& frame, const participants::Roster& roster,
               MessageSink& sink);

 private:
  Status write_surfaces(const step::PublishedFrame& frame, MessageSink& sink);
  Status write_surface(const step::PublishedFrame& frame, bool is_keyframe, MessageSink& sink);

  std::string organ_name_;
  wire::SurfaceLayout layout_;       // of the last frame
  wire::QuantisedSurface baseline_;  // the last surface written
  wire::BloodLevels blood_baseline_;
  Frame baseline_frame_ = 0;
  bool has_baseline_ = false;
  Tick last_key_tick_ = 0;
  step::TickDecisions last_decisions_;
  bool has_decisions_ = false;
};

}  // namespace trocar::recording
