#pragma once

// The log as one JSON object per line, for programs that collect logs:
//
//   {"time":"2026-01-31T12:00:00.123Z","program":"trocar-server","level":"info","message":"..."}

#include <spdlog/formatter.h>

#include <memory>
#include <string>

namespace trocar::log {

class JsonFormatter final : public spdlog::formatter {
 public:
  void format(const spdlog::details::log_msg& line, spdlog::memory_buf_t& text) override;
  std::unique_ptr<spdlog::formatter> clone() const override;
};

// Lines that follow are in `format`: "text" leaves them as they are, "json" makes objects of them.
// Call it after configure().
void use_format(const std::string& format);

}  // namespace trocar::log
