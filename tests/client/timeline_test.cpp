#include <gtest/gtest.h>

#include "client/ui/hud.h"

namespace trocar::ui {
namespace {

TEST(Timeline, GoesFromEventToEvent) {
  replica::PlaybackStory story;
  story.events = {{1000, replica::PlaybackEventKind::Person, "a"},
                  {5000, replica::PlaybackEventKind::Cut, "b"},
                  {9000, replica::PlaybackEventKind::Gap, "c"}};
  HudTimeline timeline{.last_seconds = 10, .position_seconds = 5};
  EXPECT_FALSE(event_beside(timeline, true)) << "nothing is known yet";
  timeline.story = std::make_shared<const replica::PlaybackStory>(story);
  EXPECT_DOUBLE_EQ(event_beside(timeline, true).value(), 9);
  EXPECT_DOUBLE_EQ(event_beside(timeline, false).value(), 1);
  timeline.position_seconds = 5.4;
  EXPECT_DOUBLE_EQ(event_beside(timeline, false).value(), 5);
  timeline.is_playing = true;
  EXPECT_DOUBLE_EQ(event_beside(timeline, false).value(), 1) << "it would go back for ever";
  timeline.position_seconds = 9.5;
  EXPECT_FALSE(event_beside(timeline, true));
  timeline.position_seconds = 0.5;
  EXPECT_FALSE(event_beside(timeline, false));
}

}  // namespace
}  // namespace trocar::ui
