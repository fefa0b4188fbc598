// The gate without a network: how many refusals are written, and what a use is.

#include "server/session/access/gate.h"

#include <gtest/gtest.h>

#include <fstream>

#include "tests/secure/folder.h"

namespace trocar::access {
namespace {

constexpr std::uint64_t kSecond = 1'000'000'000;
constexpr std::int64_t kNow = 1000;

class GateTest : public ::testing::Test {
 protected:
  Gate make(std::int64_t uses) {
    auto book = *CodeBook::open(folder_.path(), 7690, false, kNow);
    secret_ = *book.issue(wire::Role::Surgeon, kNow + 10, uses);
    auto audit = AuditLog::open(folder_.path() / "audit.jsonl");
    return {
        std::move(book), std::move(*audit), {[this] { return clock_ns_; }, [] { return kNow; }}};
  }
  std::vector<std::string> audit() const {
    std::vector<std::string> lines;
    std::ifstream in(folder_.path() / "audit.jsonl");
    for (std::string line; std::getline(in, line);) lines.push_back(line);
    return lines;
  }

  testing::Folder folder_;
  secure::HalfCode secret_{};
  std::uint64_t clock_ns_ = 1000 * kSecond;
};

TEST_F(GateTest, ten_refusals_a_second_are_written_and_the_rest_counted) {
  auto gate = make(-1);
  const Applicant eve{"10.0.0.1", "Eve\"}\n{\"event\":\"join\"", wire::Role::Surgeon};
  for (int i = 0; i < 17; ++i) gate.note_refusal(eve, "no");
  EXPECT_EQ(audit().size(), 10u);
  clock_ns_ += kSecond;
  gate.note_refusal(eve, "no");
  const auto lines = audit();
  ASSERT_EQ(lines.size(), 11u) << "a name does not begin a line";
  EXPECT_EQ(lines[9].find("left_out"), std::string::npos) << lines[9];
  EXPECT_NE(lines[10].find("\"left_out\":7"), std::string::npos) << lines[10];
  EXPECT_EQ(gate.counters().refused, 18u);
}

TEST_F(GateTest, a_check_takes_no_use_and_the_last_use_is_taken_once) {
  auto gate = make(1);
  Applicant ada{"10.0.0.1", "Ada", wire::Role::Surgeon},
      ben{"10.0.0.2", "Ben", wire::Role::Surgeon};
  EXPECT_FALSE(gate.check(ada, secret_));
  EXPECT_FALSE(gate.check(ben, secret_));
  EXPECT_TRUE(gate.admit(ada));
  EXPECT_FALSE(gate.admit(ben));
  const auto refusal = gate.check(ben, secret_);
  ASSERT_TRUE(refusal);
  EXPECT_EQ(refusal->kind, RefusalKind::UsedUp);
  EXPECT_EQ(gate.counters().wrong_tries, 0u);
}

TEST_F(GateTest, a_relay_comes_with_an_observers_code_alone) {
  auto gate = make(-1);
  Applicant relay{"10.0.0.1", "Relay", wire::Role::Observer};
  EXPECT_FALSE(gate.check(relay, secret_)) << "a surgeon may watch";
  relay.relays = true;
  const auto refusal = gate.check(relay, secret_);
  ASSERT_TRUE(refusal);
  EXPECT_EQ(refusal->kind, RefusalKind::RoleNotAllowed);
  EXPECT_NE(refusal->text.find("give it the observer's"), std::string::npos) << refusal->text;
  EXPECT_FALSE(gate.check(relay, *gate.book().issue(wire::Role::Observer, kNow + 10, -1)));
}

TEST_F(GateTest, a_hello_without_a_code_is_refused_and_no_try) {
  auto gate = make(-1);
  Applicant ada{"10.0.0.1", "Ada", wire::Role::Surgeon};
  for (int i = 0; i < 20; ++i) {
    const auto refusal = gate.check(ada, {});
    ASSERT_TRUE(refusal);
    EXPECT_EQ(refusal->kind, RefusalKind::WrongCode);
  }
  EXPECT_FALSE(gate.check(ada, secret_));
  EXPECT_EQ(ada.code, 1u);
}

}  // namespace
}  // namespace trocar::access
