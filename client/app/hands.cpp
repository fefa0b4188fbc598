#include "client/app/hands.h"

#include <algorithm>
#include <span>

#include "client/replica/client_messages.h"
#include "common/math/box.h"

namespace trocar::app {
namespace {

constexpr double kBefore_m = 0.03, kApart_m = 0.06;

// Returns a place in front of the organ; several are side by side.
Vec3d place_before(const replica::Topology& topology, std::size_t i, std::size_t count) {
  Box<float> box;
  for (const auto& place : topology.rest_positions) box.include(place);
  const Vec3d middle = to_double((box.least + box.most) * 0.5f);
  const double aside = (static_cast<double>(i) - 0.5 * static_cast<double>(count - 1)) * kApart_m;
  return {middle.x + aside, middle.y, static_cast<double>(box.most.z) + kBefore_m};
}

class FeltLine final : public replica::HandLine {
 public:
  explicit FeltLine(std::span<const std::unique_ptr<FeltHand>> hands) {
    for (const auto& hand : hands) hands_.push_back(hand.get());
  }

  void take(const wire::HapticLaw& law) override {
    for (auto* hand : hands_) hand->take(law);
  }
  void take(const wire::HapticPatch& patch) override {
    if (patch.tool < hands_.size()) hands_[patch.tool]->take(patch);
  }
  std::optional<replica::HandLineReading> pop_reading(std::uint64_t now_ns) override {
    for (std::size_t i = 0; i < hands_.size(); ++i)
      if (const auto reading = hands_[i]->pop_reading(now_ns))
        return replica::HandLineReading{
            static_cast<std::uint32_t>(i),
            {{to_float(reading->tip_m), reading->orientation}, reading->verb},
            reading->time_us};
    return std::nullopt;
  }
  std::optional<wire::HandReport> pop_report() override {
    for (std::size_t i = 0; i < hands_.size(); ++i)
      if (auto report = hands_[i]->pop_report()) {
        report->tool = static_cast<std::uint8_t>(i);
        return report;
      }
    return std::nullopt;
  }

 private:
  std::vector<FeltHand*> hands_;
};

}  // namespace

Hands Hands::mouse(std::span<const tool::Instrument> table, const tool::Instrument& first,
                   int count) {
  using Side = device::MouseTool::Side;
  const auto chosen = static_cast<std::size_t>(&first - table.data());
  Hands hands;
  hands.table_ = table;
  for (int i = 0; i < count; ++i)
    hands.mouse_.push_back(
        {device::MouseTool(first.shape, i == 0 ? Side::Right : Side::Left), chosen, {}});
  return hands;
}

Hands Hands::scripted(tool::Script script) {
  Hands hands;
  for (const auto& tool : script.tools) hands.script_shapes_.push_back(tool.shape);
  hands.script_ = std::move(script);
  return hands;
}

Hands Hands::felt(std::vector<std::unique_ptr<FeltHand>> felt) {
  Hands hands;
  hands.felt_ = std::move(felt);
  hands.line_ = std::make_unique<FeltLine>(hands.felt_);
  return hands;
}

Hands Hands::replayed(std::vector<std::unique_ptr<FeltReplay>> replayed) {
  Hands hands;
  hands.replayed_ = std::move(replayed);
  return hands;
}

std::vector<tool::ToolShape> Hands::shapes() const {
  if (felt_.empty() && mouse_.empty()) return script_shapes_;
  std::vector<tool::ToolShape> shapes;
  for (const auto& hand : mouse_) shapes.push_back(hand.tool.shape());
  for (const auto& hand : felt_) shapes.push_back(hand->shape());
  return shapes;
}

const device::MouseTool* Hands::mouse_tool(int number) const {
  const auto at = static_cast<std::size_t>(number);
  return at < mouse_.size() ? &mouse_[at].tool : nullptr;
}

Hands::Choice Hands::choice() const {
  if (mouse_.empty()) return {};
  return {table_, mouse_[moved_].instrument, moved_, mouse_.size()};
}

void Hands::take(std::size_t instrument, replica::SessionSource& source) {
  if (mouse_.empty() || instrument >= table_.size()) return;
  auto& hand = mouse_[moved_];
  if (hand.instrument == instrument) return;
  const auto& shape = table_[instrument].shape;
  if (!replica::send_tool_change(source, static_cast<std::uint32_t>(moved_), shape)) return;
  hand.instrument = instrument;
  hand.tool.take(shape);
  hand.asked.push_back(shape);
}

// Instruments that it has asked for itself appear in the list later, in the same order.
void Hands::take_what_is_listed(const replica::Replica& replica) {
  const auto* own = replica.told().find_participant(replica.own_slot());
  for (std::size_t i = 0; own != nullptr && i < std::min(mouse_.size(), own->tools.size()); ++i) {
    auto& hand = mouse_[i];
    const auto& shape = own->tools[i];
    const bool is_new = hand.listed && *hand.listed != shape;
    hand.listed = shape;
    if (!is_new) continue;
    const auto asked = std::ranges::find(hand.asked, shape);
    if (asked != hand.asked.end()) {
      hand.asked.erase(hand.asked.begin(), asked + 1);
      continue;
    }
    hand.asked.clear();
    hand.tool.take(shape);
    const auto known = std::ranges::find(table_, shape, &tool::Instrument::shape);
    if (known != table_.end()) hand.instrument = static_cast<std::size_t>(known - table_.begin());
  }
}

void Hands::switch_hand(const device::PointerInput& input, const device::ViewRays& view) {
  if (mouse_.size() < 2) return;
  mouse_[moved_].tool.leave();
  moved_ = (moved_ + 1) % mouse_.size();
  mouse_[moved_].tool.come_back(input, view);
}

void Hands::set_view(const Quatf& world_from_camera) {
  for (const auto& hand : felt_) hand->set_view(world_from_camera);
}

std::vector<FeltFigures> Hands::figures() const {
  std::vector<FeltFigures> all;
  for (const auto& hand : felt_) all.push_back(hand->figures());
  for (const auto& hand : replayed_) all.push_back(hand->figures());
  return all;
}

std::vector<const haptics::Trace*> Hands::let_go() {
  // All at once, as each takes a while.
  for (auto& hand : felt_) hand->let_go();
  for (auto& hand : replayed_) hand->let_go();
  std::vector<const haptics::Trace*> traces;
  for (auto& hand : felt_) traces.push_back(hand->stop());
  for (auto& hand : replayed_) traces.push_back(hand->stop());
  return traces;
}

Status Hands::tend_felt(const replica::Replica& replica) {
  for (std::size_t i = 0; i < felt_.size(); ++i) {
    auto& hand = *felt_[i];
    if (!hand.is_started())
      if (const auto started = hand.start(place_before(replica.topology(), i, felt_.size()));
          !started)
        return started;
    if (const auto checked = hand.check(); !checked) return checked;
    while (const auto sent = hand.pop_sent())
      if (i == 0) echo_.note_sent(sent->tip_m, sent->ns);
  }
  return {};
}

void Hands::send(replica::SessionSource& source, std::uint32_t tool, const tool::ToolSample& sample,
                 std::uint64_t now_ns) {
  if (tool == 0) echo_.note_sent(sample.world_from_tool.position, now_ns);
  // Dropped when the queue is full: the next sample says more.
  replica::send_tool_sample(source, tool, ++sequence_, sample);
}

std::optional<double> Hands::observe_echo_ms(const replica::Replica& replica,
                                             std::uint64_t likely_ns, std::uint64_t now_ns) {
  const auto own = tool_slot(replica.own_slot(), 0);
  for (auto frame = replica.history().rbegin(); frame != replica.history().rend(); ++frame) {
    if (!frame->has_state) continue;
    const auto tool = std::ranges::find(frame->tools, own, &replica::Tool::slot);
    if (tool == frame->tools.end()) return std::nullopt;
    return echo_.observe_ms(tool->world_from_tool.position, likely_ns, now_ns);
  }
  return std::nullopt;
}

void Hands::send_script(const replica::SessionFrame& newest, replica::SessionSource& source,
                        std::uint64_t now_ns) {
  constexpr double kInterval = 1e-9 * static_cast<double>(device::kSampleIntervalNs);
  const double seconds = script_clock_.seconds(newest.tick, newest.arrival_ns, now_ns);
  // A hand is not silent while time stands still.
  if (seconds - script_sent_seconds_ < kInterval &&
      now_ns - script_sent_ns_ < device::kSampleIntervalNs)
    return;
  script_sent_seconds_ = seconds;
  script_sent_ns_ = now_ns;
  for (std::size_t tool = 0; tool < script_hand_->tool_count(); ++tool)
    send(source, static_cast<std::uint32_t>(tool), script_hand_->sample(tool, seconds), now_ns);
}

Status Hands::send_due(const replica::Replica& replica, replica::SessionSource& source,
                       std::uint64_t now_ns) {
  if (replica.newest() == nullptr || source.state() != replica::SourceState::Live) return {};
  if (const auto* playback = source.playback())
    for (auto& hand : replayed_)
      if (const auto updated = hand->update(*playback, now_ns); !updated) return updated;
  if (const auto tended = tend_felt(replica); !tended) return tended;
  take_what_is_listed(replica);
  for (std::size_t i = 0; i < mouse_.size(); ++i)
    if (const auto sample = mouse_[i].tool.pop_due(now_ns))
      send(source, static_cast<std::uint32_t>(i), *sample, now_ns);
  if (script_) {
    auto hand = device::ScriptHand::make(std::move(*script_), replica.topology().rest_positions,
                                         replica.topology().triangles);
    script_.reset();
    if (!hand) return hand.error();
    script_hand_ = std::move(*hand);
  }
  if (script_hand_) send_script(*replica.newest(), source, now_ns);
  return {};
}

}  // namespace trocar::app
