// Plays a recording through the native replica and prints, for each frame, its number, its tick and
// the CRC-32 of the surface that the replica then holds.

#include <cstdio>

#include "client/replica/replica.h"
#include "common/base/json.h"
#include "common/journal/session_journal.h"
#include "common/wire/quantise.h"
#include "proto/wire.pb.h"

namespace trocar {
namespace {

// Messages of one tick come in this order: what a frame needs goes before it.
int order_of(std::string_view topic) {
  if (topic == "/topology") return 0;
  if (topic == "/topology/change") return 1;
  if (topic == "/surface/key") return 2;
  return topic == "/surface/delta" ? 3 : -1;
}

void print_frame(const replica::Replica& replica, Frame& last) {
  const auto* newest = replica.newest();
  if (newest == nullptr || newest->frame == last) return;
  last = newest->frame;
  std::printf("%llu %llu %s\n", static_cast<unsigned long long>(newest->frame),
              static_cast<unsigned long long>(newest->tick),
              hex32(wire::surface_crc(newest->surface)).c_str());
}

bool parse(std::string_view topic, BytesView bytes, proto::Envelope& message) {
  const auto* at = bytes.data();
  const int size = static_cast<int>(bytes.size());
  switch (order_of(topic)) {
    case 0:
      return message.mutable_surface_topology()->ParseFromArray(at, size);
    case 1:
      return message.mutable_surface_change()->ParseFromArray(at, size);
    default:
      return message.mutable_surface_frame()->ParseFromArray(at, size);
  }
}

int run(const char* file) {
  auto journal = journal::SessionJournal::open(file);
  if (!journal) return report("frame_crcs", journal.error());
  replica::Replica replica([](const proto::Envelope&) { return true; });
  Frame last = ~Frame{0};
  bool has_key = false;
  const auto visited = (*journal)->read_all([&](std::string_view topic, Tick, BytesView bytes) {
    // After the first keyframe the deltas lead on, and the surface's changes tell what cuts do.
    const int order = order_of(topic);
    if (order < 0 || (has_key && (order == 0 || order == 2))) return true;
    has_key = has_key || order == 2;
    proto::Envelope message;
    if (!parse(topic, bytes, message)) return false;
    replica.on_message(message, 0, bytes.size());
    print_frame(replica, last);
    return replica.fault().ok();
  });
  const auto& counters = replica.counters();
  const auto wrong =
      counters.crc_mismatches + counters.base_mismatches + counters.change_mismatches;
  std::fprintf(stderr, "%llu frames, %llu wrong\n",
               static_cast<unsigned long long>(counters.frames),
               static_cast<unsigned long long>(wrong));
  return visited.status().ok() && replica.fault().ok() && wrong == 0 ? 0 : 1;
}

}  // namespace
}  // namespace trocar

int main(int argc, char** argv) {
  return argc == 2 ? trocar::run(argv[1]) : 2;
}
