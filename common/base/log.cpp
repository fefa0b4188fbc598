#include "common/base/log.h"

#include <spdlog/sinks/stdout_color_sinks.h>

#include <memory>
#include <string>

#include "common/base/bounded_sink.h"

namespace trocar::log {

Status configure(std::string_view program, std::string_view level) {
  const bool known =
      level == "error" || level == "warn" || level == "info" || level == "debug" || level == "off";
  if (!known)
    return Error{ErrorCode::Usage, "--log-level: '" + std::string(level) +
                                       "' is not one of error, warn, info, debug, off"};
  auto logger = std::make_shared<spdlog::logger>(
      std::string(program),
      std::make_shared<BoundedSink>(std::make_shared<spdlog::sinks::stderr_color_sink_mt>()));
  logger->set_pattern("%H:%M:%S.%e %n %^%l%$ %v");
  logger->set_level(spdlog::level::from_str(std::string(level)));
  logger->flush_on(spdlog::level::info);
  spdlog::set_default_logger(std::move(logger));
  return {};
}

}  // namespace trocar::log
