#include "server/app/journal_sink.h"

#include <ctime>

namespace trocar::app {

Result<std::unique_ptr<JournalSink>> open_journal(const std::string&, const scene::Organ&,
                                                  const wire::SurfaceLayout&) {
  return std::unique_ptr<JournalSink>();
}

std::string default_journal_path() {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  char text[64];
  std::strftime(text, sizeof text, "./trocar-%Y%m%dT%H%M%SZ.mcap", &utc);
  return text;
}

}  // namespace trocar::app
