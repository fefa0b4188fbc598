#include "server/session/recording/surface_reader.h"

#include <algorithm>

namespace trocar::recording {
namespace {

constexpr Tick kTicksAtOnce = 1024;

}  // namespace

SurfaceReader::SurfaceReader(std::shared_ptr<journal::SessionJournal> journal, Tick from, Tick to)
    : journal_(std::move(journal)), from_(from), to_(std::min(to, journal_->info().last_tick)) {
  // Damage before it costs only the frames until the next keyframe.
  const auto key = journal_->surface_key_before(from);
  read_to_ = key && *key ? (*key)->tick() : 0;
}

Error SurfaceReader::damaged(Tick tick, const StoredDifference& difference) const {
  return {ErrorCode::BadFile, journal_->container().path() + ": surface at tick " +
                                  std::to_string(tick) + ": " + difference.field + " is " +
                                  difference.recorded + ", must be " + difference.found};
}

Status SurfaceReader::read_on() {
  const Tick from = read_to_;
  const Tick to = std::min(to_, from + kTicksAtOnce - 1);
  std::vector<Message> read;
  const auto take_frame = [&read](Tick tick, const proto::SurfaceFrame& frame) {
    read.push_back({tick, frame.is_keyframe() ? 1 : 2, {}, frame});
    return true;
  };
  if (auto s =
          journal_->read_topology_changes(from, to,
                                          [&read](Tick tick, const proto::SurfaceChange& change) {
                                            read.push_back({tick, 0, change, {}});
                                            return true;
                                          });
      !s)
    return s;
  if (auto s = journal_->read_surface_keys(from, to, take_frame); !s) return s;
  if (auto s = journal_->read_surface_deltas(from, to, take_frame); !s) return s;
  std::ranges::stable_sort(read, [](const Message& a, const Message& b) {
    return a.tick != b.tick ? a.tick < b.tick : a.order < b.order;
  });
  messages_.insert(messages_.end(), std::make_move_iterator(read.begin()),
                   std::make_move_iterator(read.end()));
  read_to_ = to + 1;
  return {};
}

Result<bool> SurfaceReader::show(const Message& message) {
  if (message.change) {
    if (const auto wrong = surface_.check(*message.change)) return damaged(message.tick, *wrong);
    return false;
  }
  const auto& frame = *message.frame;
  // A keyframe says the same as its delta, where that could be read.
  const bool is_known = surface_.layout() != nullptr && shown_ == message.tick;
  if (frame.is_keyframe() && !is_known &&
      (surface_.layout() == nullptr || surface_.layout()->epoch != frame.epoch())) {
    const auto topology = journal_->topology_before(message.tick);
    if (!topology) return topology.error();
    if (*topology)
      if (const auto wrong = surface_.check(**topology)) return damaged(message.tick, *wrong);
  }
  if (is_known && !frame.is_keyframe()) return false;
  if (const auto wrong = surface_.check(frame)) return damaged(message.tick, *wrong);
  return surface_.layout() != nullptr && !is_known;
}

Result<std::optional<SurfaceAt>> SurfaceReader::next() {
  while (true) {
    while (!messages_.empty()) {
      const Message message = std::move(messages_.front());
      messages_.pop_front();
      const auto is_shown = show(message);
      if (!is_shown) return is_shown.error();
      if (!*is_shown) continue;
      shown_ = message.tick;
      if (message.tick >= from_) return std::optional(frame_at(message.tick));
    }
    if (read_to_ > to_) return std::optional<SurfaceAt>();
    if (auto s = read_on(); !s) return s.error();
  }
}

SurfaceAt SurfaceReader::frame_at(Tick tick) const {
  SurfaceAt out{.tick = tick};
  const auto& layout = *surface_.layout();
  const auto& surface = surface_.surface();
  out.positions_m.reserve(3 * surface.size());
  for (std::size_t i = 0; i < surface.size(); ++i) {
    const Vec3f p = wire::to_metres(layout.rest_quanta[i] + surface[i]);
    out.positions_m.insert(out.positions_m.end(), {p.x, p.y, p.z});
  }
  for (const auto& corners : layout.triangles)
    if (corners[0].is_valid())
      out.triangles.insert(out.triangles.end(),
                           {corners[0].value, corners[1].value, corners[2].value});
  return out;
}

}  // namespace trocar::recording
