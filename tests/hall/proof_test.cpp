// Who has the hall's key may ask over the bus, once for each request; nobody else may.

#include "server/hall/proof/proof.h"

#include <gtest/gtest.h>

namespace trocar::hall {
namespace {

constexpr std::int64_t kNow = 1'800'000'000;
constexpr const char* kHall = "ward-7";

// A request to the hall of `check`, by a client whose clock is `ahead_s` ahead.
BusRequest request_to(const ProofCheck& check, const std::string& key,
                      const std::string& hall = kHall, std::int64_t ahead_s = 0) {
  auto request = read_bus_request(
      write_bus_request(hall, check.start(), "POST", "/sessions", "{}", key, kNow + ahead_s));
  EXPECT_TRUE(request.ok());
  return *request;
}

TEST(BusProof, is_right_once_and_for_its_own_request_alone) {
  ProofCheck check(kHall, "the key");
  const auto request = request_to(check, "the key");
  EXPECT_EQ(request.method, "POST");
  EXPECT_EQ(request.path, "/sessions");
  EXPECT_EQ(request.body, "{}");
  auto other = request;
  other.body = "{\"start\":\"liver\"}";
  EXPECT_EQ(check.check(other, kNow), Proof::Wrong);
  EXPECT_EQ(check.check(request, kNow), Proof::Right);
  EXPECT_EQ(check.check(request, kNow + 1), Proof::Wrong) << "overheard and said again";
  EXPECT_EQ(check.check(request_to(check, "the key"), kNow), Proof::Right);
}

TEST(BusProof, is_wrong_with_another_key_and_at_another_time) {
  ProofCheck check(kHall, "the key");
  EXPECT_EQ(check.check(request_to(check, "another"), kNow), Proof::Wrong);
  EXPECT_EQ(check.check(request_to(check, "the key"), kNow + ProofCheck::kMostSkew_s + 1),
            Proof::Wrong);
  EXPECT_EQ(check.check(request_to(check, "the key"), kNow - ProofCheck::kMostSkew_s - 1),
            Proof::Wrong);
  auto moved = request_to(check, "the key");
  moved.unix_s += 1;
  EXPECT_EQ(check.check(moved, kNow), Proof::Wrong);
}

TEST(BusProof, is_wrong_at_another_hall) {
  ProofCheck check(kHall, "the key");
  EXPECT_EQ(check.check(request_to(check, "the key", "ward-8"), kNow), Proof::Wrong);
}

TEST(BusProof, is_wrong_at_a_hall_that_was_started_since) {
  ProofCheck before(kHall, "the key"), after(kHall, "the key");
  for (const std::int64_t ahead_s : {-50, 0, 50}) {
    const auto request = request_to(before, "the key", kHall, ahead_s);
    EXPECT_EQ(before.check(request, kNow), Proof::Right);
    EXPECT_EQ(after.check(request, kNow + 6), Proof::Wrong) << ahead_s;
  }
}

TEST(BusProof, is_not_needed_by_who_has_no_key) {
  ProofCheck check(kHall, "the key");
  EXPECT_EQ(check.check(request_to(check, ""), kNow), Proof::None);
}

TEST(BusProof, what_is_no_request_is_an_error) {
  for (const char* text : {"", "[]", "{}", "{\"method\": 1, \"path\": \"/\"}", "nonsense"})
    EXPECT_FALSE(read_bus_request(text).ok()) << text;
}

}  // namespace
}  // namespace trocar::hall
