#include "common/base/json_log.h"

#include <gtest/gtest.h>
#include <spdlog/details/log_msg.h>

#include <chrono>
#include <string>

#include "common/base/json.h"

namespace trocar::log {
namespace {

std::string formatted(const std::string& message, std::chrono::milliseconds since_epoch) {
  const spdlog::details::log_msg line(spdlog::log_clock::time_point(since_epoch), {},
                                      "trocar-server", spdlog::level::warn, message);
  spdlog::memory_buf_t text;
  JsonFormatter().clone()->format(line, text);
  return {text.data(), text.size()};
}

TEST(JsonLog, ALineIsAnObject) {
  EXPECT_EQ(formatted("a \"name\" joined", std::chrono::milliseconds(1'700'000'000'042)),
            "{\"time\":\"2023-11-14T22:13:20.042Z\",\"program\":\"trocar-server\","
            "\"level\":\"warning\",\"message\":\"a \\\"name\\\" joined\"}\n");
}

TEST(JsonLog, NoMessageForgesALineOrBreaksTheObject) {
  for (const std::string& message :
       {std::string("a\nb"), std::string("\xff\xfe"), std::string("\x1b[2J"), std::string("\"}{"),
        std::string("\0", 1), std::string("\\"), std::string(100'000, 'x'), std::string()}) {
    const auto text = formatted(message, std::chrono::milliseconds(0));
    EXPECT_EQ(text.find('\n'), text.size() - 1);
    const auto json = Json::parse(text, nullptr, false);
    ASSERT_TRUE(json.is_object()) << text;
    EXPECT_EQ(json.size(), 4u);
  }
}

}  // namespace
}  // namespace trocar::log
