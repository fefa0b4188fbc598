#include "server/web/practice/practice_queue.h"

#include <gtest/gtest.h>

namespace trocar::practice {
namespace {

constexpr Limits kLimits{.longest_s = 600, .idle_s = 100};

class PracticeQueueTest : public ::testing::Test {
 protected:
  const Visitor* ask(const std::string& ticket, double now_s, const std::string& from = "a") {
    return queue_.ask(ticket, ticket, from, now_s);
  }
  void begin(double now_s) {
    auto* next = queue_.begin_next(now_s);
    ASSERT_NE(next, nullptr);
    next->name = "of " + next->ticket;
    queue_.set_running(next->ticket, "at " + next->ticket, "code", now_s);
  }
  std::vector<std::string> end_those_over(double now_s) {
    return queue_.end_those_over(now_s, [this](const std::string&) { return use_; });
  }

  PracticeQueue queue_{kLimits};
  Use use_;
};

TEST_F(PracticeQueueTest, GivesPlacesInOrderAndSaysHowLongItTakes) {
  ask("one", 0);
  ask("two", 1);
  ask("three", 2);
  begin(10);
  EXPECT_EQ(ask("one", 20)->step, Step::Practising);
  EXPECT_EQ(ask("one", 20)->session, "at one");
  EXPECT_DOUBLE_EQ(queue_.left_s(*ask("one", 20), 20), 590);
  EXPECT_EQ(queue_.number_of(*ask("two", 20)), 1);
  EXPECT_EQ(queue_.number_of(*ask("three", 20)), 2);
  // The only session ends after 590 s at the latest, and the next one 600 s later.
  EXPECT_DOUBLE_EQ(*queue_.wait_s(*ask("two", 20), 20), 590);
  EXPECT_DOUBLE_EQ(*queue_.wait_s(*ask("three", 20), 20), 1190);
  begin(30);
  EXPECT_DOUBLE_EQ(*queue_.wait_s(*ask("three", 30), 30), 580);
}

TEST_F(PracticeQueueTest, KnowsNoTimeWhereNoSessionOfItsOwnEnds) {
  EXPECT_FALSE(queue_.wait_s(*ask("one", 0), 0));
}

TEST_F(PracticeQueueTest, BeginsOneAtATimeAndPutsBackWhomTheHallRefuses) {
  ask("one", 0);
  ask("two", 0);
  EXPECT_EQ(queue_.begin_next(1)->ticket, "one");
  EXPECT_EQ(queue_.begin_next(1), nullptr);
  queue_.put_back("one");
  EXPECT_EQ(queue_.number_of(*ask("one", 2)), 1);
  EXPECT_EQ(queue_.begin_next(2)->ticket, "one");
}

TEST_F(PracticeQueueTest, EndsWhoIsIdleAwayOrLate) {
  ask("one", 0);
  begin(0);
  use_ = {.people = 1, .deed_s = 50};
  EXPECT_TRUE(end_those_over(149).empty());
  EXPECT_EQ(end_those_over(150), std::vector<std::string>{"of one"});
  EXPECT_EQ(ask("one", 151)->step, Step::Over);
  EXPECT_EQ(ask("one", 151)->why, "You did nothing for 100 seconds, and the session has ended.");
  EXPECT_TRUE(end_those_over(152).empty()) << "it ends once";

  ask("two", 200);
  begin(200);
  use_ = {.people = 0, .deed_s = 230};
  EXPECT_TRUE(end_those_over(200 + kAwayAfter_s - 1).empty());
  EXPECT_EQ(end_those_over(200 + kAwayAfter_s), std::vector<std::string>{"of two"});

  ask("three", 300);
  begin(300);
  use_ = {.people = 1, .deed_s = 899};
  EXPECT_TRUE(end_those_over(899).empty());
  EXPECT_EQ(end_those_over(900), std::vector<std::string>{"of three"});
  EXPECT_EQ(queue_.find("one"), nullptr) << "nobody is told for ever";
}

TEST_F(PracticeQueueTest, ForgetsWhoWaitsAndAsksNoMore) {
  ask("one", 0);
  ask("two", 5);
  end_those_over(kGoneAfter_s);
  EXPECT_EQ(queue_.find("one"), nullptr);
  EXPECT_EQ(queue_.number_of(*ask("two", kGoneAfter_s)), 1);
}

TEST_F(PracticeQueueTest, HasBounds) {
  for (int i = 0; i < kMostPerAddress; ++i) ASSERT_NE(ask("a" + std::to_string(i), 0), nullptr);
  EXPECT_EQ(ask("one more", 0), nullptr);
  EXPECT_NE(ask("a0", 0), nullptr) << "who is known is no newcomer";
  for (std::size_t i = queue_.waiting(); i < kMostWaiting; ++i)
    ASSERT_NE(ask(std::to_string(i), 0, std::to_string(i)), nullptr);
  EXPECT_EQ(ask("last", 0, "last"), nullptr);
}

TEST_F(PracticeQueueTest, EndsAllWithTheProgram) {
  ask("one", 0);
  ask("two", 0);
  begin(0);
  EXPECT_EQ(queue_.end_all("over", 1), std::vector<std::string>{"of one"});
  EXPECT_EQ(queue_.waiting(), 0u);
  EXPECT_EQ(queue_.practising(), 0u);
}

}  // namespace
}  // namespace trocar::practice
