// Who has the hall's key may ask over the bus, once for each request; nobody else may.

#include "server/hall/proof/proof.h"

#include <gtest/gtest.h>

namespace trocar::hall {
namespace {

constexpr std::int64_t kNow = 1'800'000'000, kStart = kNow - 1000;
constexpr const char* kHall = "ward-7";

BusRequest request_with(const std::string& key, const std::string& body = "{}",
                        const std::string& hall = kHall) {
  auto request = read_bus_request(write_bus_request(hall, "POST", "/sessions", body, key, kNow));
  EXPECT_TRUE(request.ok());
  return *request;
}

TEST(BusProof, is_right_once_and_for_its_own_request_alone) {
  ProofCheck check(kHall, "the key", kStart);
  const auto request = request_with("the key");
  EXPECT_EQ(request.method, "POST");
  EXPECT_EQ(request.path, "/sessions");
  EXPECT_EQ(request.body, "{}");
  auto other = request;
  other.body = "{\"start\":\"liver\"}";
  EXPECT_EQ(check.check(other, kNow), Proof::Wrong);
  EXPECT_EQ(check.check(request, kNow), Proof::Right);
  EXPECT_EQ(check.check(request, kNow + 1), Proof::Wrong) << "overheard and said again";
  EXPECT_EQ(check.check(request_with("the key"), kNow), Proof::Right);
}

TEST(BusProof, is_wrong_with_another_key_and_at_another_time) {
  ProofCheck check(kHall, "the key", kStart);
  EXPECT_EQ(check.check(request_with("another"), kNow), Proof::Wrong);
  EXPECT_EQ(check.check(request_with("the key"), kNow + ProofCheck::kMostSkew_s + 1), Proof::Wrong);
  EXPECT_EQ(check.check(request_with("the key"), kNow - ProofCheck::kMostSkew_s - 1), Proof::Wrong);
  auto moved = request_with("the key");
  moved.unix_s += 1;
  EXPECT_EQ(check.check(moved, kNow), Proof::Wrong);
}

TEST(BusProof, is_wrong_at_another_hall) {
  ProofCheck check(kHall, "the key", kStart);
  EXPECT_EQ(check.check(request_with("the key", "{}", "ward-8"), kNow), Proof::Wrong);
}

TEST(BusProof, is_wrong_at_a_hall_that_was_started_since) {
  const auto request = request_with("the key");
  EXPECT_EQ(ProofCheck(kHall, "the key", kNow).check(request, kNow + 1), Proof::Wrong);
  EXPECT_EQ(ProofCheck(kHall, "the key", kNow - 1).check(request, kNow + 1), Proof::Right);
}

TEST(BusProof, is_not_needed_by_who_has_no_key) {
  ProofCheck check(kHall, "the key", kStart);
  EXPECT_EQ(check.check(request_with(""), kNow), Proof::None);
}

TEST(BusProof, what_is_no_request_is_an_error) {
  for (const char* text : {"", "[]", "{}", "{\"method\": 1, \"path\": \"/\"}", "nonsense"})
    EXPECT_FALSE(read_bus_request(text).ok()) << text;
}

}  // namespace
}  // namespace trocar::hall
