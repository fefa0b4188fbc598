#include "client/replay/journal_stream.h"

#include <algorithm>
#include <array>

#include "common/base/log.h"
#include "common/wire/framing.h"

namespace trocar::replay {
namespace {

using journal::JournalTopic;

constexpr Tick kReadAheadTicks = kTicksPerSecond;
constexpr std::size_t kReadAheadBytes = 8u << 20;
constexpr std::size_t kMaxTickBytes = 64u << 20;
// How far back a search past damage looks first; four times as far each time.
constexpr Tick kFirstSearchTicks = 4 * kTicksPerSecond;

constexpr std::array kShownTopics{
    JournalTopic::SurfaceKey,     JournalTopic::SurfaceDelta, JournalTopic::Topology,
    JournalTopic::TopologyChange, JournalTopic::Participants, JournalTopic::Claims,
    JournalTopic::FrameState,     JournalTopic::Lesson,       JournalTopic::Drawing};

}  // namespace

Result<std::unique_ptr<JournalStream>> JournalStream::open(const std::string& path) {
  auto session = journal::SessionJournal::open(path);
  if (!session.ok()) return session.error();
  std::unique_ptr<JournalStream> stream(new JournalStream((*session)->info()));
  session->reset();  // one index in memory is enough
  // The session's reader gives one topic at a time; here they are wanted interleaved.
  auto mcap = journal::McapReader::open(path);
  if (!mcap.ok()) return mcap.error();
  stream->mcap_ = std::move(*mcap);
  stream->times_.start_utc_ns = stream->info_.start_utc_ns;
  if (Status found = stream->find_channels(); !found.ok()) return found.error();
  if (Status found = stream->find_first_key(); !found.ok()) return found.error();
  stream->rewind(stream->first_tick_);
  return stream;
}

Status JournalStream::find_channels() {
  topics_.resize(std::size_t{0xffff} + 1);
  for (const auto& [id, channel] : mcap_->channels())
    for (const JournalTopic topic : kShownTopics)
      if (channel.topic == journal::topic_name(topic)) topics_[id] = topic;
  return {};
}

Status JournalStream::find_first_key() {
  bool has_key = false;
  const auto report = mcap_->read(
      [this](const journal::McapChannel& c) { return topics_[c.id] == JournalTopic::SurfaceKey; },
      range(0, last_tick()),
      [&](const journal::McapMessage& m) {
        first_tick_ = times_.tick(m.log_time);
        has_key = true;
        return false;
      });
  if (report.damaged_chunks > 0) note_damage(report.first_damage);
  if (has_key) return {};
  return Error{ErrorCode::BadFile,
               path() + ": no keyframe to start from; the recording ended too early to be played"};
}

journal::TimeRange JournalStream::range(Tick from, Tick to) const {
  return {times_.log_time(from), times_.log_time(std::min(to, last_tick()))};
}

void JournalStream::rewind(Tick tick) {
  entries_.clear();
  bytes_.clear();
  next_entry_ = 0;
  read_from_ = tick;
}

Result<std::span<const JournalStream::Entry>> JournalStream::next_tick(Tick up_to) {
  if (next_entry_ == entries_.size() && read_from_ <= std::min(up_to, last_tick()))
    if (Status read = read_ahead(); !read.ok()) return read.error();
  if (next_entry_ == entries_.size() || entries_[next_entry_].tick > up_to)
    return std::span<const Entry>();
  const std::size_t begin = next_entry_;
  while (next_entry_ < entries_.size() && entries_[next_entry_].tick == entries_[begin].tick)
    ++next_entry_;
  return std::span<const Entry>(entries_).subspan(begin, next_entry_ - begin);
}

// From `read_from_`: the first tick that has messages and a second of what follows it.
Status JournalStream::read_ahead() {
  entries_.clear();
  bytes_.clear();
  next_entry_ = 0;
  Tick stopped_at = last_tick() + 1;
  Status failure;
  const auto report = mcap_->read(
      [this](const journal::McapChannel& c) { return topics_[c.id].has_value(); },
      range(read_from_, last_tick()),
      [&](const journal::McapMessage& m) {
        const JournalTopic topic = *topics_[m.channel_id];
        const Tick tick = times_.tick(m.log_time);
        if (!entries_.empty() && tick > entries_.back().tick &&
            (tick - entries_.front().tick >= kReadAheadTicks || bytes_.size() > kReadAheadBytes)) {
          stopped_at = tick;
          return false;
        }
        if (m.data.size() > wire::kMaxDownstreamBytes)
          failure = malformed(topic, tick, "is larger than 16 MiB");
        else if (bytes_.size() + m.data.size() > kReadAheadBytes + kMaxTickBytes)
          failure = malformed(topic, tick, "is one of too many at once");
        if (!failure.ok()) return false;
        entries_.push_back({topic, tick, bytes_.size(), m.data.size()});
        bytes_.insert(bytes_.end(), m.data.begin(), m.data.end());
        return true;
      });
  if (report.damaged_chunks > 0) note_damage(report.first_damage);
  read_from_ = stopped_at;
  return failure;
}

std::optional<JournalStream::Found> JournalStream::last_before(JournalTopic topic, Tick tick) {
  const Tick to = std::min(tick, last_tick());
  auto found = mcap_->last_before(journal::topic_name(topic), times_.log_time(to));
  if (found.ok()) {
    if (!*found) return std::nullopt;
    return Found{times_.tick((*found)->log_time), std::move((*found)->data)};
  }
  // The chunk that should hold it is damaged: what came before it is still good.
  note_damage(found.error());
  std::optional<Found> last;
  for (Tick span = kFirstSearchTicks; !last; span *= 4) {
    const Tick from = to > span ? to - span : 0;
    mcap_->read([&](const journal::McapChannel& c) { return topics_[c.id] == topic; },
                range(from, to),
                [&](const journal::McapMessage& m) {
                  if (!last) last.emplace();
                  last->tick = times_.tick(m.log_time);
                  last->data.assign(m.data.begin(), m.data.end());
                  return true;
                });
    if (from == 0) break;
  }
  return last;
}

Error JournalStream::malformed(JournalTopic topic, Tick tick, const std::string& what) const {
  return {ErrorCode::BadFile, path() + ": message on " + journal::topic_name(topic) + " at tick " +
                                  std::to_string(tick) + " " + what +
                                  "; was it written by another program?"};
}

void JournalStream::note_damage(const Error& damage) {
  if (damage.message == last_damage_) return;
  last_damage_ = damage.message;
  log::warn("{}; that part cannot be shown", damage.message);
}

}  // namespace trocar::replay
