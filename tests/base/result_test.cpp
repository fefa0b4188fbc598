#include "common/base/result.h"

#include <gtest/gtest.h>

#include <memory>

#include "common/base/ids.h"

namespace trocar {
namespace {

TEST(Result, HoldsAValueOrAnError) {
  const Result<int> good = 3;
  ASSERT_TRUE(good.ok());
  EXPECT_EQ(*good, 3);
  const Result<int> bad = Error{ErrorCode::Refused, "no"};
  ASSERT_FALSE(bad.ok());
  EXPECT_EQ(bad.error().message, "no");
  // A value of the error's own type is still a value.
  EXPECT_TRUE(Result<std::string>(std::string("text")).ok());
}

TEST(Result, MovesWhatCannotBeCopied) {
  Result<std::unique_ptr<int>> result = std::make_unique<int>(5);
  const std::unique_ptr<int> taken = std::move(*result);
  EXPECT_EQ(*taken, 5);
}

TEST(Result, AStatusIsOkByDefault) {
  EXPECT_TRUE(Status().ok());
  const Status failed = Error{ErrorCode::Usage, "what"};
  EXPECT_FALSE(failed.ok());
  EXPECT_EQ(failed.error().code, ErrorCode::Usage);
}

TEST(ResultDeathTest, TakingTheWrongSideIsAnInternalError) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  const Result<int> bad = Error{};
  EXPECT_DEATH(static_cast<void>(bad.value()), "internal error: ok\\(\\)");
  const Status good;
  EXPECT_DEATH(static_cast<void>(good.error()), "internal error");
}

TEST(Result, EveryErrorCodeHasItsExitCode) {
  EXPECT_EQ(exit_code_of(ErrorCode::Mismatch), ExitCode::Mismatch);
  EXPECT_EQ(exit_code_of(ErrorCode::Usage), ExitCode::Usage);
  EXPECT_EQ(exit_code_of(ErrorCode::BadFile), ExitCode::BadFile);
  EXPECT_EQ(exit_code_of(ErrorCode::BadMessage), ExitCode::BadFile);
  EXPECT_EQ(exit_code_of(ErrorCode::Refused), ExitCode::Refused);
  EXPECT_EQ(exit_code_of(ErrorCode::ResourceMissing), ExitCode::ResourceMissing);
  EXPECT_EQ(static_cast<int>(ExitCode::Mismatch), 1) << "exit codes are part of the interface";
  EXPECT_EQ(static_cast<int>(ExitCode::ResourceMissing), 5);
}

TEST(Ids, AToolSlotNamesItsOwnerAndNumber) {
  for (int owner = 0; owner < kMaxHands; ++owner)
    for (int number = 0; number < kToolsPerHand; ++number) {
      const ParticipantSlot slot{static_cast<std::uint8_t>(owner)};
      const ToolSlot tool = tool_slot(slot, number);
      EXPECT_TRUE(tool.is_valid());
      EXPECT_EQ(tool.owner(), slot);
      EXPECT_EQ(tool.number(), number);
    }
  EXPECT_FALSE(ToolSlot{}.is_valid());
  EXPECT_FALSE(ToolSlot{}.owner().is_valid());
  EXPECT_FALSE(ParticipantSlot{kMaxHands}.has_tools());
}

}  // namespace
}  // namespace trocar
