#include "client/replay/recorded_events.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "common/base/log.h"
#include "common/base/printable.h"
#include "common/journal/session_journal.h"
#include "common/tool/tool.h"

namespace trocar::replay {
namespace {

using replica::PlaybackEvent;
using Kind = replica::PlaybackEventKind;

// A refused claim is tried again and again: one event within this time.
constexpr Tick kOneRefusalTicks = 1000;

class Reader {
 public:
  Reader(journal::SessionJournal& journal, const std::atomic<bool>& is_stopping)
      : journal_(journal), is_stopping_(is_stopping), last_(journal.info().last_tick) {}

  Status read() {
    Status done = read_people();
    if (done) done = read_claims();
    if (done) done = read_lesson();
    if (done && journal_.info().gap_messages > 0) read_gaps();
    if (done) done = read_forces();
    std::ranges::stable_sort(told_.story.events, {}, &PlaybackEvent::tick);
    return done;
  }
  RecordedStory take() { return std::move(told_); }

 private:
  void add(Tick tick, Kind kind, const std::string& text) {
    if (text.empty()) return;
    if (told_.story.events.size() < kMostEvents)
      told_.story.events.push_back({tick, kind, printable(text, 200)});
    else if (!std::exchange(is_full_, true))
      log::warn("the recording has more than {} events: the rest are not on the time bar",
                kMostEvents);
  }

  Status read_people() {
    std::map<std::uint32_t, std::string> there;  // by slot
    return journal_.read_participants(0, last_, [&](Tick tick, const proto::Participants& list) {
      std::map<std::uint32_t, std::string> now;
      for (const auto& one : list.participant()) now[one.slot()] = one.name();
      for (const auto& [slot, name] : now)
        if (!there.contains(slot)) add(tick, Kind::Person, name + " joined");
      for (const auto& [slot, name] : there)
        if (!now.contains(slot)) add(tick, Kind::Person, name + " left");
      there = std::move(now);
      return !is_stopping_;
    });
  }

  Status read_claims() {
    std::map<std::uint32_t, Tick> refused;  // by tool: when last
    return journal_.read_claims(0, last_, [&](Tick tick, const proto::ClaimLog& log) {
      for (const auto& event : log.event()) {
        const bool is_push = event.verb() == proto::VERB_PUSH;
        switch (event.outcome()) {
          case proto::CLAIM_GRANTED:
            if (!is_push)
              add(tick, event.verb() == proto::VERB_CUT ? Kind::Cut : Kind::Grasp, event.text());
            break;
          case proto::CLAIM_REFUSED_HELD:
          case proto::CLAIM_REFUSED_NOTHING_IN_REACH: {
            const auto before = refused.find(event.tool());
            if (before == refused.end() || tick - before->second > kOneRefusalTicks)
              add(tick, Kind::Refusal, event.text());
            refused[event.tool()] = tick;
            break;
          }
          case proto::CLAIM_TAKEN_OVER:
          case proto::CLAIM_EXPIRED:
          case proto::CLAIM_SLIPPED:
            add(tick, Kind::Refusal, event.text());
            break;
          default:
            break;
        }
      }
      return !is_stopping_;
    });
  }

  Status read_lesson() {
    return journal_.read_lessons(0, last_, [&](Tick tick, const proto::LessonRecord& record) {
      if (record.has_teach() && record.teach().is_done())
        add(tick, Kind::Lesson, record.teach().text());
      if (record.has_stage()) add_stage(tick, record.stage());
      return !is_stopping_;
    });
  }

  void add_stage(Tick tick, const proto::LessonStage& stage) {
    if (told_.stages.size() >= kMostEvents) return;
    const bool is_known = !told_.stages.empty() &&
                          told_.stages.back().stage.name() == stage.name() &&
                          told_.stages.back().stage.begin_tick() == stage.begin_tick();
    if (stage.is_over())
      add(tick, Kind::Lesson, "the lesson is over");
    else if (!is_known)
      add(tick, Kind::Lesson, "stage: " + stage.name());
    told_.stages.push_back({tick, stage});
  }

  void read_gaps() {
    journal_.read_all([&](std::string_view topic, Tick tick, BytesView data) {
      if (topic != journal::topic_name(journal::JournalTopic::Gap)) return !is_stopping_;
      proto::JournalGap gap;
      if (gap.ParseFromArray(data.data(), static_cast<int>(data.size())))
        add(std::min(gap.first_tick() == 0 ? tick : gap.first_tick(), last_), Kind::Gap,
            gap.is_join() ? "another server went on here"
                          : std::to_string(gap.messages()) + " messages are missing from here on");
      return !is_stopping_;
    });
  }

  Status read_forces() {
    told_.story.forces_n.assign(kForceBins, 0);
    return journal_.read_frame_states(0, last_, [&](Tick tick, const proto::FrameState& state) {
      const auto bin = static_cast<std::size_t>(tick * (kForceBins - 1) / std::max<Tick>(last_, 1));
      for (const auto& tool : state.tool()) {
        const float force = std::hypot(tool.force_n().x(), tool.force_n().y(), tool.force_n().z());
        if (std::isfinite(force) && bin < kForceBins)
          told_.story.forces_n[bin] = std::max(told_.story.forces_n[bin], force);
      }
      return !is_stopping_;
    });
  }

  journal::SessionJournal& journal_;
  const std::atomic<bool>& is_stopping_;
  Tick last_;
  bool is_full_ = false;
  RecordedStory told_;
};

}  // namespace

const RecordedStage* RecordedStory::stage_at(Tick tick) const {
  const auto after = std::ranges::upper_bound(stages, tick, {}, &RecordedStage::tick);
  return after == stages.begin() ? nullptr : &*(after - 1);
}

RecordedStory read_story(const std::string& path, const std::atomic<bool>& is_stopping) {
  auto journal = journal::SessionJournal::open(path);
  if (!journal) {
    log::warn("{}: the time bar has no events", journal.error().message);
    return {};
  }
  Reader reader(**journal, is_stopping);
  if (const auto read = reader.read(); !read)
    log::warn("{}: events after that are not on the time bar", read.error().message);
  return reader.take();
}

RecordedEvents::RecordedEvents(const std::string& path) {
  reading_.start([this, path] {
    auto story = std::make_shared<const RecordedStory>(read_story(path, is_stopping_));
    const std::lock_guard lock(mutex_);
    story_ = std::move(story);
  });
}

std::shared_ptr<const RecordedStory> RecordedEvents::story() const {
  const std::lock_guard lock(mutex_);
  return story_;
}

}  // namespace trocar::replay
