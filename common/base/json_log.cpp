#include "common/base/json_log.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <iterator>

#include "common/base/printable.h"
#include "common/base/quote.h"

namespace trocar::log {
namespace {

constexpr std::size_t kMostMessageBytes = 8192;

// Bytes that are no UTF-8, which no JSON may hold, become question marks.
std::string quoted(const spdlog::string_view_t& text) {
  return quote(printable({text.data(), text.size()}, kMostMessageBytes));
}

}  // namespace

void JsonFormatter::format(const spdlog::details::log_msg& line, spdlog::memory_buf_t& text) {
  using namespace std::chrono;
  const auto since = line.time.time_since_epoch();
  const auto whole_s = duration_cast<seconds>(since);
  const auto rest_ms = duration_cast<milliseconds>(since - whole_s).count();
  fmt::format_to(std::back_inserter(text),
                 "{{\"time\":\"{:%FT%T}.{:03}Z\",\"program\":{},\"level\":{},\"message\":{}}}\n",
                 fmt::gmtime(static_cast<std::time_t>(whole_s.count())), rest_ms,
                 quoted(line.logger_name), quoted(spdlog::level::to_string_view(line.level)),
                 quoted(line.payload));
}

std::unique_ptr<spdlog::formatter> JsonFormatter::clone() const {
  return std::make_unique<JsonFormatter>();
}

void use_format(const std::string& format) {
  if (format == "json") spdlog::default_logger()->set_formatter(std::make_unique<JsonFormatter>());
}

}  // namespace trocar::log
