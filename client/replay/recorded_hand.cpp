#include "client/replay/recorded_hand.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "common/base/ids.h"
#include "common/base/printable.h"
#include "common/journal/session_journal.h"
#include "common/wire/tool_shape.h"

namespace trocar::replay {
namespace {

constexpr std::size_t kMostSamples = 4'000'000;  // four hours at 250 Hz
constexpr Tick kLongestGap = 100;
constexpr float kFarthest_m = 2;  // as a session's

Vec3f vec3_of(const proto::Vec3& v) {
  return {v.x(), v.y(), v.z()};
}

// Reads a journal once for each of what it holds.
class HandReader {
 public:
  HandReader(journal::SessionJournal& journal, const std::string& path, std::size_t tool)
      : journal_(journal), path_(path), tool_(tool) {}

  Result<RecordedHand> read(const std::string& name) {
    auto chosen = choose(name);
    if (!chosen) return chosen.error();
    hand_.name = *chosen;
    for (auto read : {&HandReader::read_places, &HandReader::read_samples, &HandReader::read_felt})
      if (const Status status = (this->*read)(); !status) return status.error();
    if (hand_.samples.empty())
      return Error{ErrorCode::BadFile, path_ + ": " + hand_.name + " did nothing with tool " +
                                           std::to_string(tool_) + ", choose another one"};
    return std::move(hand_);
  }

 private:
  struct Place {
    Tick since;
    std::optional<std::uint32_t> slot;  // none: not in the session
  };

  Result<std::string> choose(const std::string& name) const {
    std::vector<std::string> names;
    for (const auto& participant : journal_.info().participants)
      if (participant.slot() < kMaxHands &&
          std::ranges::find(names, participant.name()) == names.end())
        names.push_back(participant.name());
    if (name.empty() && names.size() == 1) return names.front();
    if (std::ranges::find(names, name) != names.end()) return name;
    if (names.empty())
      return Error{ErrorCode::BadFile,
                   path_ + ": nobody in it had tools, choose another recording"};
    std::string all;
    for (const auto& one : names) all += (all.empty() ? "" : ", ") + one;
    const std::string what = name.empty() ? std::to_string(names.size()) + " participants had tools"
                                          : "has no " + printable(name, 60);
    return Error{ErrorCode::Usage, path_ + ": " + what + ", choose one of: " + all};
  }

  Status read_places() {
    const auto status = journal_.read_participants(
        0, journal_.info().last_tick, [&](Tick tick, const proto::Participants& list) {
          std::optional<std::uint32_t> slot;
          for (const auto& one : list.participant()) {
            if (printable(one.name()) != hand_.name || one.slot() >= kMaxHands) continue;
            slot = one.slot();
            const auto number = static_cast<int>(tool_);
            if (one.tool_size() > number) hand_.shape = wire::read(one.tool(number));
          }
          places_.push_back({tick, slot});
          return true;
        });
    if (!tool::is_valid(hand_.shape))
      return Error{ErrorCode::BadFile, path_ + ": the tool of " + hand_.name +
                                           " has no possible shape; was it written by another "
                                           "program?"};
    return status;
  }

  // The tool's number in the session at a tick. Ticks must not go back.
  std::optional<std::uint32_t> tool_at(Tick tick) {
    while (place_ < places_.size() && places_[place_].since <= tick) ++place_;
    if (place_ == 0 || !places_[place_ - 1].slot) return std::nullopt;
    const auto participant = static_cast<std::uint8_t>(*places_[place_ - 1].slot);
    return tool_slot({participant}, static_cast<int>(tool_)).value;
  }

  bool is_after(Tick tick, Tick last, bool is_first, const char* what) {
    if (is_first || tick > last) return true;
    failure_ = Error{ErrorCode::BadFile, path_ + ": its " + what + " go back in time at tick " +
                                             std::to_string(tick) +
                                             "; was it written by another program?"};
    return false;
  }

  Status read_samples() {
    place_ = 0;
    auto& samples = hand_.samples;
    const auto status = journal_.read_tick_records(
        0, journal_.info().last_tick, [&](Tick tick, const proto::TickRecord& record) {
          if (record.sample().empty()) return true;
          const auto tool = tool_at(tick);
          for (const auto& input : record.sample()) {
            if (!tool || input.tool() != *tool) continue;
            const auto& q = input.orientation();
            const Quatf orientation{q.x(), q.y(), q.z(), q.w()};
            const Vec3f position = vec3_of(input.position_m());
            const float size = norm(orientation);
            const int verb = input.verb();
            if (!(length(position) <= kFarthest_m) || !(size > 0.5f && size < 2) || verb < 0 ||
                verb >= tool::kVerbCount || samples.size() == kMostSamples) {
              failure_ =
                  Error{ErrorCode::BadFile,
                        path_ + ": the sample at tick " + std::to_string(tick) +
                            (samples.size() == kMostSamples
                                 ? " is one too many, 4000000 are the most"
                                 : " is no pose of a tool; was it written by another program?")};
              return false;
            }
            const RecordedHand::Sample sample{
                tick, {position, normalized(orientation)}, static_cast<tool::Verb>(verb)};
            if (!samples.empty() && samples.back().tick == tick)
              samples.back() = sample;  // the later of one tick counts
            else if (is_after(tick, samples.empty() ? 0 : samples.back().tick, samples.empty(),
                              "samples"))
              samples.push_back(sample);
            else
              return false;
          }
          return true;
        });
    return failure_.ok() ? status : failure_;
  }

  Status read_felt() {
    place_ = 0;
    auto& felt = hand_.felt;
    const auto status = journal_.read_frame_states(
        0, journal_.info().last_tick, [&](Tick tick, const proto::FrameState& state) {
          const auto tool = tool_at(tick);
          for (const auto& one : state.tool()) {
            if (!tool || one.tool() != *tool) continue;
            const RecordedHand::Felt now{tick, vec3_of(one.position_m()), vec3_of(one.force_n()),
                                         vec3_of(one.torque_nm())};
            if (!is_finite(now.tip_m) || !is_finite(now.force_n) || !is_finite(now.torque_nm)) {
              failure_ = Error{ErrorCode::BadFile,
                               path_ + ": the force at tick " + std::to_string(tick) +
                                   " is no number; was it written by another program?"};
              return false;
            }
            if (!is_after(tick, felt.empty() ? 0 : felt.back().tick, felt.empty(), "forces"))
              return false;
            felt.push_back(now);
          }
          return true;
        });
    return failure_.ok() ? status : failure_;
  }

  journal::SessionJournal& journal_;
  const std::string& path_;
  const std::size_t tool_;
  std::vector<Place> places_;
  std::size_t place_ = 0;
  RecordedHand hand_;
  Status failure_;
};

// The one at or before a tick, or the first; how far the next one is: 0 to 1, 0 without a next.
template <typename Row>
std::pair<std::size_t, double> row_before(const std::vector<Row>& rows, double tick) {
  const auto after = std::ranges::upper_bound(
      rows, tick, {}, [](const Row& row) { return static_cast<double>(row.tick); });
  if (after == rows.begin()) return {0, 0};
  const auto index = static_cast<std::size_t>(after - rows.begin()) - 1;
  if (after == rows.end()) return {index, 0};
  const auto from = static_cast<double>(rows[index].tick);
  return {index, (tick - from) / (static_cast<double>(after->tick) - from)};
}

Result<std::size_t> tool_number(const std::string& text) {
  if (text == "0" || text == "1") return static_cast<std::size_t>(text[0] - '0');
  return Error{ErrorCode::Usage,
               "tool=" + printable(text, 20) + ": a participant has tool=0 and tool=1, choose one"};
}

// Takes ",key=value" off the text; nothing if there is none.
std::optional<std::string> take_value(std::string& text, const std::string& key) {
  const auto at = text.find("," + key + "=");
  if (at == std::string::npos) return std::nullopt;
  const auto begin = at + key.size() + 2;
  const auto end = std::min(text.find(',', begin), text.size());
  const std::string value = text.substr(begin, end - begin);
  text.erase(at, end - at);
  return value;
}

}  // namespace

RecordedHand::Sample RecordedHand::sample_at(double tick) const {
  const auto [i, share] = row_before(samples, tick);
  Sample sample = samples[i];
  if (share == 0) return sample;
  const auto part = static_cast<float>(share);
  const Pose &from = samples[i].world_from_tool, &to = samples[i + 1].world_from_tool;
  sample.world_from_tool.position = from.position + (to.position - from.position) * part;
  sample.world_from_tool.orientation = interpolate(from.orientation, to.orientation, part);
  return sample;
}

RecordedHand::FeltThen RecordedHand::felt_at(double tick) const {
  if (felt.empty() || tick < static_cast<double>(felt.front().tick) ||
      tick > static_cast<double>(felt.back().tick))
    return {};
  const auto [i, share] = row_before(felt, tick);
  const Felt& from = felt[i];
  const Felt& to = felt[std::min(i + 1, felt.size() - 1)];
  if (to.tick - from.tick > kLongestGap) return {};
  const auto between = [part = share](const Vec3f& a, const Vec3f& b) {
    return to_double(a) + (to_double(b) - to_double(a)) * part;
  };
  return {true, between(from.tip_m, to.tip_m), between(from.force_n, to.force_n),
          between(from.torque_nm, to.torque_nm)};
}

Result<RecordedHand> read_recorded_hand(const std::string& path, const std::string& name,
                                        std::size_t tool) {
  auto journal = journal::SessionJournal::open(path);
  if (!journal) return journal.error();
  return HandReader(**journal, path, tool).read(name);
}

Result<HandInFile> parse_hand_in_file(const std::string& text) {
  HandInFile hand;
  hand.path = text;
  hand.name = take_value(hand.path, "name").value_or("");
  if (const auto number = take_value(hand.path, "tool")) {
    const auto tool = tool_number(*number);
    if (!tool) return tool.error();
    hand.tool = *tool;
  }
  if (hand.path.empty())
    return Error{ErrorCode::Usage,
                 "no recording is named, write journal:FILE[,name=NAME][,tool=0]"};
  return hand;
}

Result<HandInFile> parse_hand_name(const std::string& text) {
  HandInFile hand;
  hand.name = text;
  const auto number = take_value(hand.name, "tool");
  if (!number) return hand;
  const auto tool = tool_number(*number);
  if (!tool) return tool.error();
  hand.tool = *tool;
  return hand;
}

}  // namespace trocar::replay
