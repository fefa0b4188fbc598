#include "client/replica/frame_assembler.h"

#include <algorithm>

#include "proto/wire.pb.h"

namespace trocar::replica {

void FrameAssembler::keep(Frame frame, const wire::QuantisedSurface& surface,
                          const wire::BloodLevels& blood) {
  auto& place = kept_[frame % kKept];
  place.frame = frame;
  place.surface = surface;
  place.blood = blood;
}

const FrameAssembler::Kept* FrameAssembler::find(Frame frame) const {
  const auto& place = kept_[frame % kKept];
  return place.frame == frame && !place.surface.empty() ? &place : nullptr;
}

void FrameAssembler::clear() {
  for (auto& place : kept_) place.surface.clear();
  unfinished_.clear();
  states_.clear();
}

FrameAssembler::Unfinished* FrameAssembler::find_or_begin(const proto::SurfaceSlice& slice,
                                                          std::size_t vertex_count) {
  const auto found = std::ranges::find_if(
      unfinished_, [&slice](const auto& u) { return u.header.frame == slice.frame(); });
  if (found != unfinished_.end()) {
    const bool is_same =
        found->base == slice.base_frame() && found->slices == slice.slices() &&
        found->header.epoch == slice.epoch() && found->header.surface_crc == slice.surface_crc() &&
        found->header.bleeds == slice.has_blood() && found->header.blood_crc == slice.blood_crc() &&
        found->surface.size() == vertex_count;
    return is_same ? &*found : nullptr;
  }
  const auto* base = find(slice.base_frame());
  if (base == nullptr || base->surface.size() > vertex_count) return nullptr;
  if (unfinished_.size() >= kUnfinished) unfinished_.pop_front();
  Unfinished begun;
  begun.header = {.frame = slice.frame(),
                  .tick = slice.tick(),
                  .epoch = slice.epoch(),
                  .surface_crc = slice.surface_crc(),
                  .bleeds = slice.has_blood(),
                  .blood_crc = slice.blood_crc(),
                  .server_time_us = slice.server_time_us()};
  begun.base = slice.base_frame();
  begun.slices = slice.slices();
  begun.surface = base->surface;
  begun.surface.resize(vertex_count);  // zeros, as on the server
  if (begun.header.bleeds) {
    begun.blood = base->blood;
    begun.blood.resize(vertex_count, 0);
  }
  unfinished_.push_back(std::move(begun));
  return &unfinished_.back();
}

std::optional<FrameAssembler::Whole> FrameAssembler::add(const proto::SurfaceSlice& slice,
                                                         std::size_t vertex_count) {
  if (slice.slices() == 0 || slice.slices() > wire::kMaxSlices || slice.slice() >= slice.slices())
    return std::nullopt;
  auto* frame = find_or_begin(slice, vertex_count);
  const std::uint64_t bit = std::uint64_t{1} << slice.slice();
  if (frame == nullptr || (frame->present & bit) != 0) return std::nullopt;
  wire::SurfaceSlice part{slice.first_vertex(), slice.vertices(), {}, {}};
  part.payload.assign(slice.payload().begin(), slice.payload().end());
  part.blood.assign(slice.blood().begin(), slice.blood().end());
  if (!wire::decode_slice(part, frame->surface, frame->blood)) return std::nullopt;
  frame->present |= bit;
  frame->header.payload_bytes += part.payload.size();
  const auto all =
      slice.slices() == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << slice.slices()) - 1;
  if (frame->present != all) return std::nullopt;
  Whole whole{frame->header, std::move(frame->surface), std::move(frame->blood)};
  // Older ones would come too late to be shown.
  const auto newest = whole.header.frame;
  std::erase_if(unfinished_, [newest](const auto& u) { return u.header.frame <= newest; });
  return whole;
}

std::optional<proto::FrameState> FrameAssembler::add(const proto::FrameStatePart& part) {
  if (part.parts() == 0 || part.parts() > kMaxStateParts || part.part() >= part.parts())
    return std::nullopt;
  auto found = std::ranges::find(states_, part.frame(), &State::frame);
  if (found == states_.end()) {
    if (states_.size() >= kStates) states_.pop_front();
    State begun;
    begun.frame = part.frame();
    begun.parts = part.parts();
    states_.push_back(std::move(begun));
    found = states_.end() - 1;
  }
  if (found->parts != part.parts()) return std::nullopt;
  found->bytes[part.part()] = part.state();
  found->present |= 1u << part.part();
  if (found->present != (1u << found->parts) - 1) return std::nullopt;
  std::string whole;
  for (std::uint32_t i = 0; i < found->parts; ++i) whole += found->bytes[i];
  states_.erase(found);
  proto::FrameState message;
  if (!message.ParseFromString(whole) || message.frame() != part.frame()) return std::nullopt;
  return message;
}

}  // namespace trocar::replica
