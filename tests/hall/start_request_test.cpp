#include "server/hall/plan/start_request.h"

#include <gtest/gtest.h>

#include <string>

namespace trocar::hall {
namespace {

TEST(StartRequest, ReadsWhatToStartAndItsName) {
  const auto request = parse_start_request(R"({"start": "liver", "name": "group-a"})");
  ASSERT_TRUE(request) << request.error().message;
  EXPECT_EQ(request->offer, "liver");
  EXPECT_EQ(request->name, "group-a");
  ASSERT_TRUE(parse_start_request(R"({"start":"liver"})"));
}

TEST(StartRequest, RefusesEverythingElseInOneLine) {
  const std::string deep(2000, '[');
  for (const std::string& text :
       {std::string(), std::string("{}"), std::string("[]"), std::string("\"liver\""), deep,
        std::string(R"({"start": 1})"), std::string(R"({"start": "../liver"})"),
        std::string(R"({"start": "liver", "name": ""})"),
        std::string(R"({"start": "liver", "arguments": "--organ"})"),
        std::string(R"({"name": "a"})"), std::string(5000, ' '), std::string("{\"start\": \"li"),
        std::string("{\"\xff\": 1}")}) {
    const auto request = parse_start_request(text);
    ASSERT_FALSE(request) << text;
    EXPECT_EQ(request.error().code, ErrorCode::BadMessage);
    EXPECT_EQ(request.error().message.find('\n'), std::string::npos);
  }
}

}  // namespace
}  // namespace trocar::hall
