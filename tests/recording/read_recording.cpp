#include "tests/recording/read_recording.h"

#include <gtest/gtest.h>

#include <limits>

#include "common/journal/session_journal.h"
#include "common/wire/surface_codec.h"
#include "proto/wire.pb.h"
#include "server/session/recording/stored_surface.h"

namespace trocar::recording::testing {

std::map<Tick, std::uint32_t> surfaces_of(const std::string& path) {
  std::map<Tick, std::uint32_t> crcs;
  auto journal = journal::SessionJournal::open(path);
  EXPECT_TRUE(journal.ok());
  if (!journal) return crcs;
  StoredSurface surface;
  const auto check = [&](auto message, BytesView bytes) {
    EXPECT_TRUE(message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())));
    EXPECT_FALSE(surface.check(message).has_value());
  };
  (*journal)->read_all([&](std::string_view topic, Tick tick, BytesView bytes) {
    if (topic == "/topology") check(proto::SurfaceTopology(), bytes);
    if (topic == "/topology/change") check(proto::SurfaceChange(), bytes);
    if (!topic.starts_with("/surface/")) return true;
    check(proto::SurfaceFrame(), bytes);
    if (surface.layout() != nullptr) crcs[tick] = wire::surface_crc(surface.surface());
    return true;
  });
  EXPECT_EQ(surface.undecodable(), 0u);
  return crcs;
}

std::vector<proto::Overview> overviews_of(const std::string& path) {
  std::vector<proto::Overview> overviews;
  auto journal = journal::SessionJournal::open(path);
  EXPECT_TRUE(journal.ok());
  if (!journal) return overviews;
  (*journal)->read_all([&](std::string_view topic, Tick, BytesView bytes) {
    if (topic != "/overview") return true;
    EXPECT_TRUE(
        overviews.emplace_back().ParseFromArray(bytes.data(), static_cast<int>(bytes.size())));
    return true;
  });
  return overviews;
}

}  // namespace trocar::recording::testing
