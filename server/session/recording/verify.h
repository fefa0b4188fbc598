#pragma once

// Simulates a recorded session again and compares all that the recording says of it:
//
//   /tick_batch                  state hash of every tick
//   /world/snapshot              byte for byte; restored into another simulation, which goes on
//   from
//                                it for two frames with equal hashes
//   /surface/*, /topology*       decoded, by CRC; and as messages
//   /frame_state, /tool/*        every field that is not a measured time: forces, torques, proxies
//   /claims                      every event; names are those on /participants
//   /bleeding                    the rules by which blood is simulated again; its levels are in
//                                /surface/*, its figures in /frame_state, its state in snapshots
//   /hands                       decoded, within their ranges; no simulation knows them
//   /participants                slots with tools and the tools' shapes, in frames that are a
//   second
//                                away from any change of the list: lists come from another thread,
//                                and have no exact tick. Names and roles of watchers mean nothing
//                                to a simulation and are not compared.
//
// The verdict is Verified only if all of that was there and equal from the first tick to the last.
// A difference ends the comparison. Everything else that keeps the verdict from being Verified is a
// reason: another sim_version, ticks or messages that are missing, damaged chunks, no proper end,
// an end that counts or hashes to other messages.
// After missing ticks the simulation goes on from the next snapshot.

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/base/tick.h"
#include "common/journal/session_journal.h"

namespace trocar::recording {

struct Difference {
  Tick tick = 0;
  std::string channel;  // "/frame_state"
  std::string field;    // "tool[0].force_n.x"
  std::string recorded, simulated;

  // "tick 160, /frame_state: tool[0].force_n.x is 1.5, simulated 1.25"
  std::string text() const;
};

enum class Verdict { Verified, Different, NotVerified };
const char* name_of(Verdict verdict);  // "verified", "different", "not verified"

struct VerifyReport {
  static constexpr std::size_t kMostReasons = 32;

  bool is_resimulated = false;         // false: of another sim_version, or without records or loads
  Tick begin_tick = 0;                 // after which the recording begins
  Tick first_tick = 0, last_tick = 0;  // first tick that was verified; last of the recording
  std::uint64_t ticks_verified = 0;
  std::uint64_t ticks_missing = 0;        // up to last_tick, without a record
  std::uint64_t ticks_not_simulated = 0;  // recorded, but no snapshot led to them
  std::uint64_t frames_verified = 0;      // with tools and claims
  std::uint64_t snapshots_verified = 0, snapshots_continued = 0;
  std::uint64_t surfaces_decoded = 0,
                surfaces_verified = 0;      // by their CRC; equal to the simulation
  std::uint64_t bled_surfaces = 0;          // of those decoded, with levels of blood
  std::uint64_t participants_verified = 0;  // frames in which they were compared
  std::uint64_t damaged_chunks = 0;
  std::vector<Tick> joins;  // after these, another server has gone on, from an equal state
  std::optional<Difference> first_difference;
  std::vector<std::string> reasons;  // why not all could be verified; at most kMostReasons
  std::uint64_t reasons_left_out = 0;
  std::uint64_t last_hash = 0;
  std::string container;  // one line: finished, or recovered and what was lost

  Verdict verdict() const {
    if (first_difference) return Verdict::Different;
    return reasons.empty() ? Verdict::Verified : Verdict::NotVerified;
  }
  // Reasons and first difference, a line each; empty if it is verified.
  std::string why() const;
};

// `progress` is called now and then with the tick reached. Error: the file cannot be read at all.
Result<VerifyReport> verify_journal(const std::string& path,
                                    const std::function<void(Tick, Tick last)>& progress = {});

}  // namespace trocar::recording
