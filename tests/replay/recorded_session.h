#pragma once

// A journal with a known truth: the synthetic session of tests/client, written the way a server
// records it, and the CRC of every frame.

#include <gtest/gtest.h>

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "client/replay/replay_source.h"
#include "client/replica/replica.h"
#include "common/journal/session_journal_writer.h"
#include "tests/support/files.h"

namespace trocar::replay::testing {

inline constexpr std::uint64_t kStartUtc = 1'732'200'000'000'000'000;
inline constexpr Frame kFramesPerKey = 62;

using trocar::testing::load_file;
using trocar::testing::save_file;
using trocar::testing::TemporaryFolder;

struct RecordingOptions {
  Frame frames = 400;
  Frame cut_at = 0;     // from this frame on there is another epoch: keyframe with topology
  Frame cut_every = 0;  // every so many frames a blade changes the surface, as a server records it
  Frame claim_at = 0;   // a refusal in this frame
  Frame join_at = 0;    // from one participant to two
  Frame stage_at = 0;   // a lesson's stage begins in this frame, and the lesson ends 100 later
  bool has_fine_surface = false;  // of the organ: one triangle
  bool is_finished = true;
  journal::McapWriterOptions container;
  std::uint32_t protocol_major = kProtocolMajor;
  // Changes a message before it is written; false drops it.
  std::function<bool(journal::JournalTopic, Frame, Bytes&)> tamper;
};

struct Truth {
  using Triangles = std::vector<std::array<std::uint32_t, 3>>;  // removed ones 0, 0, 0
  std::vector<std::uint32_t> crc;    // by frame; frame 0 was not published
  std::vector<std::uint32_t> epoch;  // by frame
  std::vector<Triangles> triangles;  // by frame
  Frame first_frame = 1, last_frame = 0;
};

Truth record_session(const std::string& path, const RecordingOptions& options);

// A source with a clock of its own and a replica that listens.
struct Player {
  explicit Player(const std::string& path);
  // Advances the clock and polls.
  void step(std::uint64_t milliseconds);
  // The newest frame is the one of the source's position, and bit for bit the truth.
  void expect_truth(const Truth& truth) const;
  // The newest frame, whichever it is, is the truth.
  void expect_honest(const Truth& truth) const;

  std::uint64_t now_ns = 1'000'000'000;
  Status opened;
  std::unique_ptr<ReplaySource> source;
  std::vector<proto::Envelope> sent;
  replica::Replica replica{[this](const proto::Envelope& message) {
    sent.push_back(message);
    return source->send(message);
  }};
};

}  // namespace trocar::replay::testing
