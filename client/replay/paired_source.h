#pragma once

// Two recordings that play beside each other as one source: one time, one set of controls. The
// messages of the first go to poll()'s sink, those of the second to poll_second()'s, in the same
// round. Both read one clock, so that they keep step; one that has fallen behind or run ahead by
// more than 0.4 s of its session, times the speed, is moved. What is damaged in one stops that one
// alone; the source is closed when both have stopped. Thread: the render thread.

#include <array>
#include <memory>
#include <optional>
#include <string>

#include "client/replay/aligned_time.h"
#include "client/replay/replay_source.h"

namespace trocar::replay {

enum class Alignment : std::uint8_t { Start, Stage };

class PairedSource final : public replica::SessionSource, public replica::PlaybackControl {
 public:
  // `wish`: nothing: by stages where both are of one lesson, else from the start of each.
  static Result<std::unique_ptr<PairedSource>> open(const std::string& first,
                                                    const std::string& second,
                                                    std::optional<Alignment> wish,
                                                    ReplaySource::Clock clock = monotonic_ns);

  ReplaySource& half(std::size_t i) { return *halves_[i]; }
  const ReplaySource& half(std::size_t i) const { return *halves_[i]; }
  AlignedTime::Place place(std::size_t i) const { return time_line_.place_in(i, position_); }
  // Stops one of them; `why` is one line for people.
  void stop(std::size_t i, const std::string& why) { halves_[i]->close(why); }
  // Empty: it has not stopped.
  std::string why_stopped(std::size_t i) const;

  Alignment alignment() const { return alignment_; }
  // Whether there are stages to align by; nothing: it is not known yet.
  std::optional<bool> has_stages() const;
  // The first recording keeps what it shows; without stages nothing changes.
  void align(Alignment by);

  void poll(replica::MessageSink& sink) override;
  void poll_second(replica::MessageSink& sink);
  bool send(const proto::Envelope& message) override { return halves_[0]->send(message); }
  void close(const std::string& reason) override;
  replica::SourceState state() const override;
  replica::CloseReason close_reason() const override { return halves_[0]->close_reason(); }
  replica::SourceStatistics statistics() const override { return halves_[0]->statistics(); }
  std::string name() const override;
  replica::PlaybackControl* playback() override { return this; }

  Tick first_tick() const override { return 0; }
  Tick last_tick() const override { return time_line_.last(); }
  Tick position() const override { return position_; }
  bool is_playing() const override { return is_playing_; }
  float speed() const override { return speed_; }
  void play() override;
  void pause() override { is_playing_ = false; }
  void seek(Tick tick) override;
  void set_speed(float speed) override;
  // Tells of both, each event with the name of its recording.
  std::shared_ptr<const replica::PlaybackStory> story() const override { return story_; }

 private:
  using Halves = std::array<std::unique_ptr<ReplaySource>, kPair>;
  PairedSource(Halves halves, std::shared_ptr<std::uint64_t> round_ns, ReplaySource::Clock clock,
               std::optional<Alignment> wish);
  AlignedTime::Spans spans() const;
  void read_stories();
  void tell_story();
  void steer(std::size_t i, Tick before);
  void advance(std::uint64_t now_ns);

  Halves halves_;
  std::shared_ptr<std::uint64_t> round_ns_;  // the clock of both
  ReplaySource::Clock clock_;
  std::optional<Alignment> wish_;
  Alignment alignment_ = Alignment::Start;
  AlignedTime time_line_;
  std::optional<AlignedTime> by_stage_;
  std::array<std::shared_ptr<const RecordedStory>, kPair> told_;  // by recording; null: not yet
  std::shared_ptr<const replica::PlaybackStory> story_;
  bool is_playing_ = true, is_moved_ = true;
  float speed_ = 1;
  Tick position_ = 0;
  double exact_ = 0;  // position_, with the part of a tick
  std::uint64_t last_ns_ = 0;
};

}  // namespace trocar::replay
