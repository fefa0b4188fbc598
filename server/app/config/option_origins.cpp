#include "server/app/config/option_origins.h"

#include <fmt/format.h>

namespace trocar::app {

std::string OptionOrigins::place_of(const std::string& key) const {
  const auto found = lines_.find(key);
  if (found == lines_.end()) return "--" + key;
  return fmt::format("{}:{}: key {}", file_, found->second, key);
}

std::string OptionOrigins::placed(const std::string& message) const {
  if (!message.starts_with("--")) return message;
  const auto end = message.find_first_not_of("abcdefghijklmnopqrstuvwxyz-");
  const auto key = message.substr(2, end == std::string::npos ? end : end - 2);
  if (!lines_.contains(key)) return message;
  const auto rest = message.substr(2 + key.size());
  return place_of(key) + (rest.starts_with(":") ? "" : ":") + rest;
}

}  // namespace trocar::app
