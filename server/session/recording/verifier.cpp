#include "server/session/recording/verifier.h"

#include <fmt/format.h>

#include <algorithm>

#include "common/base/json.h"
#include "common/base/version.h"
#include "common/wire/figure_messages.h"
#include "common/wire/hand_report_messages.h"
#include "common/wire/surface_messages.h"
#include "common/wire/tool_shape.h"
#include "server/session/recording/message_difference.h"
#include "server/session/recording/recorded_session.h"
#include "server/session/recording/tick_records.h"
#include "server/session/replication/messages.h"

namespace trocar::recording {
namespace {

using journal::JournalTopic;

// Lists of participants come from another thread: only frames this far from a change are compared.
constexpr Tick kSettled = 1000;
// From a snapshot on, so many ticks are compared: two frames.
constexpr Tick kContinued = 2 * kTicksPerFrame;

// A recording of ours has one of each at a time; a file that has more is not believed.
constexpr std::size_t kMostPending = 16;

constexpr const char* kTickBatches = "/tick_batch";
constexpr const char* kSnapshots = "/world/snapshot";

std::string ticks_text(Tick first, Tick last) {
  return first == last ? fmt::format("tick {}", first) : fmt::format("ticks {} to {}", first, last);
}
std::string topic_of_tool(std::uint32_t tool) {
  return fmt::format("/tool/{}", tool);
}

// A copy without what may differ: times that were measured with what the rate controller made of
// them, which no simulation can repeat, and surfaces as bytes, which are compared as surfaces.
std::unique_ptr<google::protobuf::Message> comparable(const google::protobuf::Message& message) {
  std::unique_ptr<google::protobuf::Message> copy(message.New());
  copy->CopyFrom(message);
  if (auto* state = dynamic_cast<proto::FrameState*>(copy.get()))
    wire::write(wire::PaceFigures{}, *state);
  if (auto* surface = dynamic_cast<proto::SurfaceFrame*>(copy.get())) surface->clear_payload();
  return copy;
}

// Clears what depends on lists of participants.
void clear_names(google::protobuf::Message& message) {
  auto* claims = dynamic_cast<proto::ClaimLog*>(&message);
  if (claims == nullptr) return;
  for (auto& event : *claims->mutable_event()) {
    event.clear_holder_name();
    event.clear_text();
  }
}

template <typename Message>
bool parse(BytesView bytes, Message& message) {
  return bytes.size() <= journal::kMaxChunkBytes &&
         message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()));
}

bool is_older(const std::string& protocol) {
  return protocol != fmt::format("{}.{}", kProtocolMajor, kProtocolMinor);
}

}  // namespace

class Verifier::Collector final : public MessageSink {
 public:
  explicit Collector(std::vector<Expected>& into) : into_(into) {}
  Status write(JournalTopic topic, const google::protobuf::Message& message) override {
    if (topic != JournalTopic::TickBatch)  // it is what the simulation began with
      into_.push_back({journal::topic_name(topic), comparable(message)});
    return {};
  }
  Status write(const proto::ToolState& tool) override {
    into_.push_back({topic_of_tool(tool.tool()), comparable(tool)});
    return {};
  }

 private:
  std::vector<Expected>& into_;
};

Verifier::Verifier(const journal::SessionInfo& info, step::Simulation simulation,
                   VerifyReport& report)
    : info_(info),
      report_(report),
      is_older_(is_older(info.protocol)),
      simulation_(std::move(simulation)),
      messages_(simulation_.organ().name, simulation_.layout()) {
  begin_tick_ = info_.begin_tick();
  begins_with_snapshot_ = info_.begins_with_snapshot();
  next_tick_ = begin_tick_ + 1;
  if (!report_.is_resimulated) return;
  is_in_step_ = !begins_with_snapshot_;
  if (!is_in_step_) return;
  proto::SurfaceTopology topology;
  wire::write(simulation_.layout(), simulation_.organ().name, topology);
  expected_.push_back({journal::topic_name(JournalTopic::Topology), comparable(topology)});
  is_comparing_ = true;
}

Verifier::~Verifier() = default;

void Verifier::add_list(Tick tick, const proto::Participants& list) {
  List entry{.tick = tick, .tools = {}};
  for (const auto& participant : list.participant()) {
    if (participant.slot() >= kMaxHands) continue;
    auto& tools = entry.tools[static_cast<std::uint8_t>(participant.slot())];
    for (const auto& shape : participant.tool()) tools.push_back(wire::read(shape));
  }
  lists_.push_back(std::move(entry));
}

void Verifier::differ(Difference difference) {
  if (!report_.first_difference) report_.first_difference = std::move(difference);
}

void Verifier::add_reason(std::string reason) {
  if (report_.reasons.size() < VerifyReport::kMostReasons)
    report_.reasons.push_back(std::move(reason));
  else
    ++report_.reasons_left_out;
}

bool Verifier::check(std::string_view topic, BytesView bytes) {
  const auto counted = message_counts_.find(topic);
  if (counted != message_counts_.end())
    ++counted->second;
  else
    message_counts_.emplace(topic, 1);
  const auto known = journal::topic_of(topic);
  std::unique_ptr<google::protobuf::Message> message;
  if (known) {
    message.reset(google::protobuf::MessageFactory::generated_factory()
                      ->GetPrototype(&journal::topic_message(*known))
                      ->New());
  } else if (topic.starts_with("/tool/")) {
    message = std::make_unique<proto::ToolState>();
  } else {
    if (message_counts_.find(topic)->second == 1)
      add_reason(fmt::format("{}: this program does not know that channel", topic));
    return true;
  }
  if (!parse(bytes, *message)) {
    add_reason(fmt::format("after tick {}: a message on {} cannot be read", next_tick_ - 1, topic));
    return true;
  }
  if (!known) {
    compare(topic, *message);
    return !report_.first_difference;
  }
  switch (*known) {
    case JournalTopic::Organ:  // checked by its hash
      break;
    case JournalTopic::Loads:  // the simulation has them, and these
    case JournalTopic::Bleeding:
    case JournalTopic::Threads:
      if (message_counts_.find(topic)->second > 1)
        add_reason(fmt::format("{}: there are others, after tick {}", topic, next_tick_ - 1));
      break;
    case JournalTopic::Snapshot:
      end_frame();
      check_snapshot(static_cast<const proto::WorldSnapshot&>(*message));
      break;
    case JournalTopic::TickBatch:
      end_frame();
      check_batch(static_cast<const proto::TickBatch&>(*message));
      break;
    case JournalTopic::Participants:
      end_frame();
      roster_ =
          participants::Roster(participants_of(static_cast<const proto::Participants&>(*message)));
      break;
    case JournalTopic::Gap:
      end_frame();
      check_gap(static_cast<const proto::JournalGap&>(*message));
      break;
    case JournalTopic::SurfaceKey:
    case JournalTopic::SurfaceDelta:
    case JournalTopic::Topology:
    case JournalTopic::TopologyChange:
      if (waits_for_begin() && !first_topology_ && *known == JournalTopic::Topology) {
        check_surface(*known, *message);
        first_topology_ = std::move(message);
        break;
      }
      compare(topic, *message);
      check_surface(*known, *message);
      break;
    case JournalTopic::Hands:  // clients have said so: no simulation knows it
      if (const auto read = wire::read(static_cast<const proto::HandLog&>(*message)); !read)
        add_reason(fmt::format("after tick {}: /hands: {}", next_tick_ - 1, read.error().message));
      break;
    case JournalTopic::Lesson:  // likewise; what became of tools is in the ticks
    case JournalTopic::Drawing:
    case JournalTopic::Overview:  // it says again what other channels say
      break;
    case JournalTopic::Claims:
    case JournalTopic::FrameState:
      compare(topic, *message);
      break;
  }
  return !report_.first_difference;
}

// ---- ticks ----

void Verifier::check_snapshot(const proto::WorldSnapshot& snapshot) {
  const auto tick = snapshot.tick();
  const auto hash = xxh3_64(bytes_of(std::string_view(snapshot.state())));
  if (hash != snapshot.state_hash())
    return differ({tick, kSnapshots, "hash of state", hex64(snapshot.state_hash()), hex64(hash)});
  if (snapshot.organ_hash() != info_.organ_hash)
    return differ(
        {tick, kSnapshots, "organ_hash", hex64(snapshot.organ_hash()), hex64(info_.organ_hash)});
  if (!report_.is_resimulated) return;
  if (waits_for_begin() && tick == begin_tick_) return begin_from(snapshot);
  if (snapshots_.size() >= kMostPending)
    return add_reason(fmt::format("tick {}: too many snapshots wait for their tick", tick));
  snapshots_[tick] = snapshot;
  if (is_in_step_ && tick == simulation_.current_tick()) compare_snapshot(tick);
}

void Verifier::check_batch(const proto::TickBatch& batch) {
  for (const auto& record : batch.record()) {
    if (report_.first_difference) return;
    check_record(record);
  }
}

// Records of ticks up to `before` - 1 are not there.
void Verifier::note_missing(Tick before) {
  if (next_tick_ >= before) return;
  report_.ticks_missing += before - next_tick_;
  const bool is_marked = gap_end_ + 1 >= before;  // a reason has been given
  if (!is_marked)
    add_reason(ticks_text(next_tick_, before - 1) + ": not in the recording, without a marked gap");
  is_in_step_ = false;
}

void Verifier::check_record(const proto::TickRecord& message) {
  const Tick tick = message.tick();
  if (tick < next_tick_)
    return add_reason(fmt::format("tick {}: recorded after tick {}", tick, next_tick_ - 1));
  note_missing(tick);
  next_tick_ = tick + 1;
  if (!report_.is_resimulated) return;
  if (auto read = from_message(message, record_); !read) {
    is_in_step_ = false;
    ++report_.ticks_not_simulated;
    return add_reason(read.error().message);
  }
  if (!is_in_step_) {
    is_frame_whole_ = false;
    records_.clear();
    if (!start_from_snapshot(tick)) ++report_.ticks_not_simulated;
    return;
  }
  const auto& done = simulation_.tick(record_.inputs, record_.decisions);
  if (done.state_hash != record_.state_hash)
    return differ(
        {tick, kTickBatches, "state_hash", hex64(record_.state_hash), hex64(done.state_hash)});
  if (report_.ticks_verified++ == 0) report_.first_tick = tick;
  report_.last_hash = done.state_hash;
  records_.push_back(record_);
  continue_snapshots(done.state_hash);
  if (report_.first_difference) return;
  if (snapshots_.contains(tick)) compare_snapshot(tick);
  if (auto frame = simulation_.pop_frame()) begin_frame(*frame);
}

bool Verifier::start_from_snapshot(Tick tick) {
  const auto found = snapshots_.find(tick);
  if (found == snapshots_.end()) return false;
  const auto state = bytes_of(std::string_view(found->second.state()));
  const Status restored = simulation_.restore_snapshot(state);
  if (!restored.ok() || simulation_.current_tick() != tick) {
    differ({tick, kSnapshots, "state",
            restored.ok() ? fmt::format("a state of tick {}", simulation_.current_tick())
                          : restored.error().message,
            "a state"});
    return false;
  }
  report_.last_hash = record_.state_hash;
  is_in_step_ = true;
  has_key_schedule_ = false;
  messages_ = FrameMessages(simulation_.organ().name, simulation_.layout());
  snapshots_.erase(snapshots_.begin(), std::next(found));
  // Its own hash is that of the tick's record.
  const auto hash = simulation_.state_hash();
  // Publishing changes the state after the hash was taken.
  if (!publishes_frame(tick) && hash != record_.state_hash)
    differ({tick, kSnapshots, "state_hash", hex64(record_.state_hash), hex64(hash)});
  ++report_.ticks_not_simulated;
  return true;
}

void Verifier::begin_from(const proto::WorldSnapshot& snapshot) {
  if (std::exchange(knows_begin_, false)) {
    if (!is_state(snapshot)) return;
    ++report_.snapshots_verified;
  }
  const Status restored =
      simulation_.restore_snapshot(bytes_of(std::string_view(snapshot.state())));
  if (!restored.ok() || simulation_.current_tick() != snapshot.tick())
    return differ({snapshot.tick(), kSnapshots, "state",
                   restored.ok() ? "of another tick" : restored.error().message, "a state"});
  is_in_step_ = true;
  messages_ = FrameMessages(simulation_.organ().name, simulation_.layout());
  if (!first_topology_) return;
  proto::SurfaceTopology topology;
  wire::write(simulation_.layout(), simulation_.organ().name, topology);
  if (auto field = first_difference(*first_topology_, topology, is_older_))
    differ({snapshot.tick(), "/topology", field->field, field->recorded, field->simulated});
}

bool Verifier::is_state(const proto::WorldSnapshot& snapshot) {
  const Tick tick = snapshot.tick();
  const auto recorded = bytes_of(std::string_view(snapshot.state()));
  Bytes state;
  simulation_.write_snapshot(state);
  const auto [in_recorded, in_state] = std::ranges::mismatch(recorded, state);
  if (in_recorded == recorded.end() && in_state == state.end()) return true;
  const auto text = [](auto at, auto end) {
    return at == end ? std::string("nothing") : fmt::format("0x{:02x}", *at);
  };
  differ({tick, kSnapshots, fmt::format("byte {} of state", in_state - state.begin()),
          text(in_recorded, recorded.end()), text(in_state, state.end())});
  return false;
}

// The simulation is at this tick, and so is a snapshot.
void Verifier::compare_snapshot(Tick tick) {
  const auto found = snapshots_.find(tick);
  if (!is_state(found->second)) return;
  const auto recorded = bytes_of(std::string_view(found->second.state()));
  ++report_.snapshots_verified;
  if (continuations_.size() >= kMostPending)
    return add_reason(fmt::format("tick {}: too many snapshots at once to go on from", tick));
  Continuation next{simulation_.beside(), tick, tick + kContinued};
  if (const Status restored = next.simulation.restore_snapshot(recorded); !restored.ok())
    return differ({tick, kSnapshots, "state", "cannot be restored: " + restored.error().message,
                   "a state that can"});
  continuations_.push_back(std::move(next));
  snapshots_.erase(snapshots_.begin(), std::next(found));
}

void Verifier::continue_snapshots(std::uint64_t hash) {
  for (auto& restored : continuations_) {
    const auto& done = restored.simulation.tick(record_.inputs, record_.decisions);
    if (done.state_hash != hash)
      return differ({record_.tick, kSnapshots,
                     fmt::format("state_hash, going on from tick {}", restored.tick), hex64(hash),
                     hex64(done.state_hash)});
  }
  report_.snapshots_continued += std::erase_if(
      continuations_, [&](const Continuation& restored) { return restored.until <= record_.tick; });
}

void Verifier::check_join(Tick tick) {
  surface_.skip();
  if (tick + 1 < next_tick_ || tick > report_.last_tick)
    return add_reason(
        fmt::format("a join after tick {} comes after tick {}", tick, next_tick_ - 1));
  if (!report_.joins.empty() && report_.joins.back() == tick)
    return add_reason(fmt::format("a join after tick {} is there twice", tick));
  if (report_.joins.size() == journal::kMostParts)
    return add_reason(fmt::format("a join after tick {} is one more than the {} that a session has",
                                  tick, journal::kMostParts));
  note_missing(tick + 1);
  next_tick_ = tick + 1;
  report_.joins.push_back(tick);
  if (!report_.is_resimulated) return;
  knows_begin_ = is_in_step_;
  begin_tick_ = tick;
  begins_with_snapshot_ = true;
  first_topology_.reset();
  records_.clear();
  is_in_step_ = false;
  has_key_schedule_ = true;
}

void Verifier::check_gap(const proto::JournalGap& gap) {
  if (gap.is_join()) return check_join(gap.last_tick());
  gap_end_ = gap.last_tick();
  add_reason(ticks_text(gap.first_tick(), gap.last_tick()) +
             ": a marked gap, the session did not record them");
  surface_.skip();
  has_key_schedule_ = false;
}

// ---- frames ----

void Verifier::begin_frame(step::PublishedFrame& frame) {
  frame.figures.state_hash = report_.last_hash;
  frame.records = std::exchange(records_, {});
  frame_tick_ = frame.tick;
  frame_crc_ = frame.surface_crc;
  has_frame_ = true;
  expected_.clear();
  if (!has_key_schedule_) static_cast<void>(messages_.skip(&simulation_.layout(), {}));
  // After a restart figures of the first frame may be of ticks that were not simulated.
  const bool is_whole = std::exchange(is_frame_whole_, true);
  // A frame's own change is in the layout already.
  if (!has_key_schedule_) frame.change = nullptr;
  Collector collector(expected_);
  static_cast<void>(messages_.write(frame, roster_, collector));
  if (!is_whole) expected_.clear();
  is_comparing_ = is_whole;
  if (is_whole && !has_key_schedule_) {
    constexpr std::array kOfSurface{JournalTopic::SurfaceKey, JournalTopic::SurfaceDelta,
                                    JournalTopic::Topology};
    std::erase_if(expected_, [&](const Expected& entry) {
      return std::ranges::any_of(
          kOfSurface, [&](auto topic) { return entry.topic == journal::topic_name(topic); });
    });
  }
  compare_participants(frame.tick);
}

void Verifier::compare_participants(Tick tick) {
  if (!has_all_lists_) return;
  const auto next = std::ranges::upper_bound(lists_, tick, {}, &List::tick);
  const bool is_settled = (next == lists_.begin() || std::prev(next)->tick + kSettled <= tick) &&
                          (next == lists_.end() || tick + kSettled <= next->tick);
  if (!is_settled) return;
  static const List kNobody;
  const List& list = next == lists_.begin() ? kNobody : *std::prev(next);
  for (std::uint8_t slot = 0; slot < kMaxHands; ++slot) {
    const auto found = list.tools.find(slot);
    for (int i = 0; i < kToolsPerHand; ++i) {
      const auto& tool = simulation_.state().tools[tool_slot({slot}, i)];
      const auto number = static_cast<std::size_t>(i);
      const bool is_listed = found != list.tools.end() && number < found->second.size();
      if (is_listed != tool.is_present)
        return differ({tick, "/participants", fmt::format("slot {}, tool {}", slot, i),
                       is_listed ? "there" : "nothing", tool.is_present ? "there" : "nothing"});
      if (is_listed && found->second[number] != tool.shape)
        return differ({tick, "/participants", fmt::format("slot {}, tool {}: shape", slot, i),
                       fmt::format("radius {} m", found->second[number].radius_m),
                       fmt::format("radius {} m", tool.shape.radius_m)});
    }
  }
  ++report_.participants_verified;
}

void Verifier::check_surface(JournalTopic topic, const google::protobuf::Message& message) {
  StoredSurface::Check wrong;
  Tick tick = next_tick_ - 1;
  if (topic == JournalTopic::Topology) {
    wrong = surface_.check(static_cast<const proto::SurfaceTopology&>(message));
  } else if (topic == JournalTopic::TopologyChange) {
    wrong = surface_.check(static_cast<const proto::SurfaceChange&>(message));
  } else {
    const auto& surface = static_cast<const proto::SurfaceFrame&>(message);
    tick = surface.tick();
    const auto decoded = surface_.decoded();
    wrong = surface_.check(surface);
    const bool is_decoded = surface_.decoded() > decoded;
    if (!wrong && is_decoded && has_frame_ && frame_tick_ == tick) {
      if (surface.surface_crc() != frame_crc_)
        wrong = StoredDifference{"surface_crc", fmt::format("{:08x}", surface.surface_crc()),
                                 fmt::format("{:08x}", frame_crc_)};
      else
        ++report_.surfaces_verified;
    }
    // From here on the rule by which keyframes are due is known again.
    if (is_decoded && topic == JournalTopic::SurfaceKey) has_key_schedule_ = true;
  }
  if (wrong)
    differ({tick, journal::topic_name(topic), wrong->field, wrong->recorded, wrong->found});
}

void Verifier::compare(std::string_view topic, const google::protobuf::Message& recorded) {
  if (!is_comparing_) {
    if (report_.is_resimulated) ++not_compared_;
    return;
  }
  const auto found = std::ranges::find(expected_, topic, &Expected::topic);
  const bool is_of_surface = topic.starts_with("/surface/") || topic.starts_with("/topology");
  if (found == expected_.end()) {
    if (is_of_surface && !has_key_schedule_) return;
    return differ({frame_tick_, std::string(topic), "message", "there", "nothing"});
  }
  const auto copy = comparable(recorded);
  if (!has_all_lists_) clear_names(*copy), clear_names(*found->message);
  if (auto field = first_difference(*copy, *found->message, is_older_))
    return differ(
        {frame_tick_, std::string(topic), field->field, field->recorded, field->simulated});
  expected_.erase(found);
  if (topic != journal::topic_name(JournalTopic::FrameState)) return;
  ++report_.frames_verified;
  end_frame();  // it is the last message of a frame
}

// A message that the simulation expects and the recording has not shown is missing.
void Verifier::end_frame() {
  for (const auto& entry : expected_)
    add_reason(fmt::format("tick {}: a message on {} is missing", frame_tick_, entry.topic));
  expected_.clear();
  has_frame_ = is_comparing_ = false;
}

void Verifier::finish(const journal::McapReader& container) {
  report_.surfaces_decoded = surface_.decoded();
  report_.bled_surfaces = surface_.bled();
  if (report_.first_difference) return;
  end_frame();
  if (next_tick_ == info_.begin_tick() + 1 && report_.last_tick > info_.begin_tick()) {
    add_reason("no tick records: nothing can be simulated again");
    report_.ticks_missing = report_.last_tick - info_.begin_tick();
    report_.is_resimulated = false;
  } else {
    note_missing(report_.last_tick + 1);
  }
  for (const auto& restored : continuations_) {
    const bool has_frame = frame_of(next_tick_ - 1) > frame_of(restored.tick);
    if (has_frame)
      ++report_.snapshots_continued;
    else
      add_reason(fmt::format("tick {}: the recording ends before the frame after that snapshot",
                             restored.tick));
  }
  if (not_compared_ > 0)
    add_reason(fmt::format("{} messages: of frames that were not simulated", not_compared_));
  if (surface_.undecodable() > 0)
    add_reason(fmt::format("{} surfaces: what comes before them is missing, they cannot be decoded",
                           surface_.undecodable()));
  for (const auto& [tick, snapshot] : snapshots_)
    add_reason(fmt::format("tick {}: nothing was simulated to compare the snapshot with", tick));
  if (report_.ticks_not_simulated > 0)
    add_reason(fmt::format("{} ticks: recorded, but no snapshot before them to simulate from",
                           report_.ticks_not_simulated));
  if (!container.is_finished()) return;
  for (const auto& [id, channel] : container.channels()) {
    const auto& counts = container.statistics().channel_message_counts;
    const auto said = counts.find(id);
    const auto there = message_counts_.find(channel.topic);
    const auto expected = said == counts.end() ? 0 : said->second;
    const auto found = there == message_counts_.end() ? 0 : there->second;
    if (expected != found && report_.damaged_chunks == 0)
      add_reason(fmt::format("{}: {} messages, the file's summary counts {}", channel.topic, found,
                             expected));
  }
}

}  // namespace trocar::recording
