#include "client/crtk/operating_state.h"

#include <gtest/gtest.h>

namespace trocar::crtk {
namespace {

struct Step {
  const char* command;
  OperatingState after;
  bool is_followed = true;
};

TEST(OperatingState, FollowsTheCommandsOfCrtk) {
  using enum State;
  OperatingState state;
  EXPECT_EQ(state, (OperatingState{Disabled, false, false}));
  for (const auto& [command, after, is_followed] : std::initializer_list<Step>{
           {"pause", {Disabled, false, false}, false},
           {"resume", {Disabled, false, false}, false},
           {"enable", {Enabled, false, false}},
           {"home", {Enabled, false, true}},
           {"pause", {Paused, false, true}},
           {"enable", {Paused, false, true}, false},
           {"resume", {Enabled, false, true}},
           {"unhome", {Enabled, false, false}},
           {"Home", {Enabled, false, false}, false},
           {"", {Enabled, false, false}, false},
           {"disable", {Disabled, false, false}},
       }) {
    EXPECT_EQ(state.follow(command, "").ok(), is_followed) << command;
    EXPECT_EQ(state, after) << command;
  }
}

TEST(OperatingState, AFaultStaysUntilSomebodyEnablesOrDisables) {
  OperatingState state{State::Enabled, true, true};
  state.fail();
  EXPECT_EQ(state, (OperatingState{State::Fault, true, false}));
  EXPECT_FALSE(state.follow("resume", "").ok());
  EXPECT_FALSE(state.follow("home", "").ok());
  const auto enabled = state.follow("enable", "the session cannot be reached");
  EXPECT_EQ(enabled.error().message, "state_command: enable: the session cannot be reached");
  EXPECT_EQ(state.state, State::Fault);
  EXPECT_TRUE(state.follow("enable", "").ok());
  EXPECT_TRUE(state.can_move());
}

TEST(OperatingState, MovesOnlyWhenEnabledHomedAndIdle) {
  EXPECT_TRUE((OperatingState{State::Enabled, true, false}.can_move()));
  EXPECT_FALSE((OperatingState{State::Enabled, true, true}.can_move()));
  EXPECT_FALSE((OperatingState{State::Enabled, false, false}.can_move()));
  EXPECT_FALSE((OperatingState{State::Paused, true, false}.can_move()));
  EXPECT_FALSE((OperatingState{State::Disabled, true, false}.can_move()));
}

}  // namespace
}  // namespace trocar::crtk
