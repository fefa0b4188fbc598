#include "client/app/picture_series.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "client/app/picture.h"
#include "client/replay/replay_source.h"
#include "common/base/log.h"

namespace trocar::app {

Status write_picture_series(const ClientOptions& options) {
  std::error_code failed;
  std::filesystem::create_directories(options.series_folder, failed);
  if (failed)
    return Error{ErrorCode::ResourceMissing,
                 "--pictures: cannot make the folder " + options.series_folder};
  std::uint64_t now_ns = 1'000'000'000;
  auto source = replay::ReplaySource::open(options.replay_file, [&now_ns] { return now_ns; });
  if (!source) return source.error();
  replay::ReplaySource& recording = **source;
  ClientOptions in_memory = options;
  in_memory.display = Display::Headless;
  auto picture = Picture::make(in_memory, "Trocar: " + recording.name());
  if (!picture) return picture.error();
  replica::Replica replica(
      [&recording](const proto::Envelope& message) { return recording.send(message); });
  Hands hands;
  const auto tick_of = [](double seconds) {
    return static_cast<Tick>(std::llround(seconds * 1e3));
  };
  const Tick last = options.series_to_s > 0
                        ? std::min(tick_of(options.series_to_s), recording.last_tick())
                        : recording.last_tick();
  recording.seek(tick_of(options.series_from_s));
  const auto step_ns = static_cast<std::uint64_t>(1e9 / options.series_rate);
  int count = 0;
  do {
    recording.poll(replica);
    if (!replica.fault().ok()) return replica.fault().error();
    if (recording.state() == replica::SourceState::Closed)
      return Error{ErrorCode::BadFile, recording.close_reason().text};
    // Panels that have never been drawn do not know their size yet, nor those beside them.
    if (count == 0)
      for (int i = 0; i < 3; ++i) (*picture)->draw(replica, recording, hands, now_ns);
    (*picture)->draw(replica, recording, hands, now_ns);
    char name[32];
    std::snprintf(name, sizeof name, "/%06d.png", ++count);
    if (const auto saved = (*picture)->save(options.series_folder + name); !saved)
      return saved.error();
    now_ns += step_ns;
  } while (recording.position() < last && recording.is_playing());
  log::info("{} pictures in {}", count, options.series_folder);
  return {};
}

}  // namespace trocar::app
