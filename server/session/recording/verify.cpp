#include "server/session/recording/verify.h"

#include <algorithm>
#include <cstdio>
#include <map>

#include "common/base/version.h"
#include "common/journal/session_journal.h"
#include "common/wire/surface_codec.h"
#include "common/wire/surface_messages.h"
#include "server/organs/organ/local_reduction_file.h"
#include "server/organs/organ/organ_file.h"
#include "server/session/recording/tick_records.h"
#include "server/tissue/step/simulation.h"

namespace trocar::recording {
namespace {

constexpr Tick kWindow = 1000;

BytesView view(const std::string& bytes) {
  return bytes_of(std::string_view(bytes));
}

class Verifier {
 public:
  Verifier(journal::SessionJournal& journal, organ::Organ organ,
           std::shared_ptr<const organ::LocalReduction> reduction, VerifyReport& report)
      : journal_(journal),
        simulation_(std::move(organ), 1, std::move(reduction)),
        report_(report),
        layout_(simulation_.layout()) {
    // Messages name no nodes.
    layout_.vertex_of_node.clear();
    surface_.resize(layout_.vertex_count());
  }

  // Ticks [from, to].
  void verify_window(Tick from, Tick to) {
    snapshots_.clear();
    note(journal_.read_snapshots(from, to, [&](Tick, const proto::WorldSnapshot& snapshot) {
      snapshots_[snapshot.tick()] = snapshot;
      return true;
    }));
    if (report_.is_resimulated) {
      if (from == 0) start_from_snapshot(0);
      note(journal_.read_tick_records(from, to, [&](Tick, const proto::TickRecord& message) {
        verify_tick(message);
        return report_.ok();
      }));
    }
    changes_.clear();
    note(journal_.read_topology_changes(from, to, [&](Tick tick, const proto::SurfaceChange& c) {
      changes_[tick] = c;
      return true;
    }));
    note(journal_.read_surface_deltas(from, to, [&](Tick, const proto::SurfaceFrame& frame) {
      verify_surface(frame);
      return report_.ok();
    }));
    simulated_crcs_.clear();
    simulated_sums_.clear();
  }

 private:
  void mismatch(Tick tick, const char* what) {
    if (report_.ok()) report_.first_mismatch = Mismatch{tick, what};
  }
  void note(const Status& read) {
    if (!read.ok() && report_.container.find(read.error().message) == std::string::npos)
      report_.container += "; " + read.error().message;
  }

  void start_from_snapshot(Tick tick) {
    is_in_step_ = false;
    const auto it = snapshots_.find(tick);
    if (it == snapshots_.end()) return;
    const auto state = view(it->second.state());
    if (xxh3_64(state) != it->second.state_hash()) return mismatch(tick, "snapshot's own hash");
    is_in_step_ = simulation_.restore_snapshot(state).ok() && simulation_.current_tick() == tick;
    if (!is_in_step_) return mismatch(tick, "snapshot");
    ++report_.snapshots_verified;
  }

  void verify_tick(const proto::TickRecord& message) {
    const Tick tick = message.tick();
    if (auto read = from_message(message, record_); !read) {
      note(read);
      return mismatch(tick, "tick record");
    }
    if (is_in_step_ && tick != simulation_.current_tick() + 1) is_in_step_ = false;
    if (!is_in_step_) {
      // Ticks are missing before this one: only a snapshot brings the simulation back in step.
      ++report_.ticks_missing;
      start_from_snapshot(tick);
      return;
    }
    const auto& done = simulation_.tick(record_.inputs, record_.decisions);
    if (done.state_hash != record_.state_hash) return mismatch(tick, "state hash");
    ++report_.ticks_verified;
    report_.last_hash = done.state_hash;
    if (auto frame = simulation_.take_frame()) {
      simulated_crcs_[tick] = frame->surface_crc;
      if (frame->change) simulated_sums_[tick] = frame->change->sum;
    }
    if (const auto it = snapshots_.find(tick); it != snapshots_.end()) {
      Bytes state;
      simulation_.write_snapshot(state);
      if (!std::ranges::equal(state, view(it->second.state()))) return mismatch(tick, "snapshot");
      ++report_.snapshots_verified;
    }
  }

  // Brings the layout to the epoch of a frame: by its change, or after a gap by the last topology.
  // False if the journal lacks both, or they contradict each other.
  bool follow_epoch(Tick tick, std::uint32_t epoch) {
    if (epoch == layout_.epoch) return true;
    if (const auto found = changes_.find(tick);
        found != changes_.end() && found->second.from_epoch() == layout_.epoch) {
      const auto change = wire::read(found->second, layout_);
      if (!change.ok() || !wire::apply(*change, layout_).ok()) {
        mismatch(tick, "surface change");
        return false;
      }
      const auto simulated = simulated_sums_.find(tick);
      if (simulated != simulated_sums_.end() && simulated->second != change->sum)
        mismatch(tick, "triangles of the surface");
      return layout_.epoch == epoch;
    }
    const auto topology = journal_.topology_before(tick);
    if (!topology.ok() || !topology->has_value() || (*topology)->epoch() != epoch) return false;
    auto layout = wire::read(**topology);
    if (!layout.ok()) mismatch(tick, "topology");
    if (layout.ok()) layout_ = std::move(*layout);
    return layout.ok();
  }

  void verify_surface(const proto::SurfaceFrame& frame) {
    if (frame.base_frame() != surface_frame_ || !has_surface_) {
      const auto key = journal_.surface_key_before(Tick{frame.base_frame()} * kTicksPerFrame);
      has_surface_ = key.ok() && key->has_value() && (*key)->frame() == frame.base_frame() &&
                     follow_epoch((*key)->tick(), (*key)->epoch());
      if (!has_surface_) return;  // in a gap: the next keyframe starts again
      surface_.resize(layout_.vertex_count());
      has_surface_ = wire::decode_keyframe(view((*key)->payload()), surface_).ok();
      if (!has_surface_) return;
    }
    has_surface_ = follow_epoch(frame.tick(), frame.epoch());
    if (!has_surface_) return;
    surface_.resize(layout_.vertex_count());  // new vertices count as zero in the baseline
    if (!wire::decode_delta(view(frame.payload()), surface_).ok())
      return mismatch(frame.tick(), "surface delta");
    surface_frame_ = frame.frame();
    if (wire::surface_crc(surface_) != frame.surface_crc())
      return mismatch(frame.tick(), "surface CRC");
    const auto it = simulated_crcs_.find(frame.tick());
    if (it != simulated_crcs_.end() && it->second != frame.surface_crc())
      return mismatch(frame.tick(), "surface");
    ++report_.surfaces_verified;
  }

  journal::SessionJournal& journal_;
  step::Simulation simulation_;
  VerifyReport& report_;
  step::TickRecord record_;
  bool is_in_step_ = false;
  std::map<Tick, proto::WorldSnapshot> snapshots_;  // of the window
  std::map<Tick, std::uint32_t> simulated_crcs_;    // of the window
  std::map<Tick, std::uint64_t> simulated_sums_;    // of triangles, where they changed
  std::map<Tick, proto::SurfaceChange> changes_;    // of the window
  wire::SurfaceLayout layout_;
  wire::QuantisedSurface surface_;
  Frame surface_frame_ = 0;
  bool has_surface_ = false;
};

std::string hex(std::uint64_t value) {
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(value));
  return text;
}
// "liver.reduction (hash 0123456789abcdef, liver, 16 patches)"
std::string name_of(const journal::ReductionDescription& reduction) {
  return reduction.file + " (hash " + hex(reduction.hash) + ", " + reduction.source + ")";
}

}  // namespace

Result<std::shared_ptr<const organ::LocalReduction>> reduction_of(const std::string& journal,
                                                                  const journal::SessionInfo& info,
                                                                  const organ::Organ& organ,
                                                                  const std::string& file) {
  using Shared = std::shared_ptr<const organ::LocalReduction>;
  if (!info.reduction) {
    if (file.empty()) return Shared();
    return Error{ErrorCode::Usage,
                 journal + ": was recorded without a reduction: leave out " + "--reduction"};
  }
  if (file.empty())
    return Error{ErrorCode::Usage, journal + ": was recorded with the reduction " +
                                       name_of(*info.reduction) + ": give it with --reduction"};
  auto reduction = organ::read_session_reduction(file, organ);
  if (!reduction) return reduction.error();
  if (const auto hash = organ::reduction_hash(*reduction); hash != info.reduction->hash)
    return Error{ErrorCode::BadFile, file + ": is another reduction (hash " + hex(hash) +
                                         ") than that of " + journal + ", " +
                                         name_of(*info.reduction)};
  return Shared(std::make_shared<organ::LocalReduction>(std::move(*reduction)));
}

Result<VerifyReport> verify_journal(const std::string& path,
                                    const std::function<void(Tick, Tick last)>& progress,
                                    const std::string& reduction_file) {
  auto journal = journal::SessionJournal::open(path);
  if (!journal) return journal.error();
  const auto& info = (*journal)->info();
  auto message = (*journal)->organ();
  if (!message) return message.error();
  const std::string encoded = message->SerializeAsString();
  auto organ = organ::decode_organ(view(encoded));
  if (!organ) return Error{organ.error().code, path + ": /organ: " + organ.error().message};
  if (organ::organ_hash(*organ) != info.organ_hash)
    return Error{ErrorCode::BadFile, path + ": /organ is not the organ that the session names"};

  VerifyReport report;
  report.is_resimulated = info.sim_version == kSimVersion && !info.has_external_loads;
  report.last_tick = info.last_tick;
  report.container = info.summary;
  std::shared_ptr<const organ::LocalReduction> reduction;
  if (report.is_resimulated || !reduction_file.empty()) {
    auto read = reduction_of(path, info, *organ, reduction_file);
    if (!read) return read.error();
    reduction = std::move(*read);
  }
  Verifier verifier(**journal, std::move(*organ), std::move(reduction), report);
  for (Tick from = 0; from <= info.last_tick && report.ok(); from += kWindow) {
    verifier.verify_window(from, std::min(info.last_tick, from + kWindow - 1));
    if (progress) progress(std::min(info.last_tick, from + kWindow - 1), info.last_tick);
  }
  return report;
}

}  // namespace trocar::recording
