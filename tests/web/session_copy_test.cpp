// The copy of a session from which those who come late are shown everything.

#include "server/watch/follow/session_copy.h"

#include <gtest/gtest.h>

#include "common/wire/blood_codec.h"
#include "common/wire/fine_surface.h"
#include "common/wire/surface_codec.h"
#include "common/wire/surface_messages.h"
#include "proto/wire.pb.h"

namespace trocar::follow {
namespace {

using proto::Envelope;
using wire::QuantisedSurface;

// A triangle whose corners move, told as a server tells it.
class Session {
 public:
  Session() {
    layout_.rest_quanta = {{0, 0, 0}, {100, 0, 0}, {0, 100, 0}};
    layout_.triangles = {{VertexIndex(0), VertexIndex(1), VertexIndex(2)}};
    layout_.is_wound = {0};
    layout_.node_of_vertex.resize(3);
    layout_.triangle_sum = layout_.compute_triangle_sum();
    surface_.resize(3);
  }
  Envelope topology() const {
    Envelope envelope;
    wire::write(layout_, "triangle", *envelope.mutable_surface_topology());
    return envelope;
  }
  // The next frame, as a difference from the one before, or whole.
  Envelope frame(bool is_keyframe) {
    const auto before = surface_;
    ++frame_;
    surface_[frame_ % 3].x += 5;
    Envelope envelope;
    auto& message = *envelope.mutable_surface_frame();
    message.set_frame(frame_);
    message.set_tick(16 * frame_);
    message.set_is_keyframe(is_keyframe);
    if (!is_keyframe) message.set_base_frame(frame_ - 1);
    Bytes payload;
    if (is_keyframe)
      wire::encode_keyframe(surface_, payload);
    else
      wire::encode_delta(before, surface_, payload);
    message.set_payload(payload.data(), payload.size());
    message.set_surface_crc(wire::surface_crc(surface_));
    return envelope;
  }
  const QuantisedSurface& surface() const { return surface_; }
  Frame number() const { return frame_; }

 private:
  wire::SurfaceLayout layout_;
  QuantisedSurface surface_;
  Frame frame_ = 0;
};

News take(SessionCopy& copy, const Envelope& envelope) {
  const auto news = copy.take(envelope, wire::encode_envelope(envelope));
  EXPECT_TRUE(news.ok());
  return news.ok() ? *news : News::Nothing;
}

// Adds levels of blood to a frame; `before`: those of its base.
void bleed(Envelope& frame, const wire::BloodLevels& before, const wire::BloodLevels& levels) {
  auto& message = *frame.mutable_surface_frame();
  Bytes payload;
  wire::encode_blood(message.is_keyframe() ? BytesView() : BytesView(before), levels, payload);
  message.set_blood(payload.data(), payload.size());
  message.set_blood_crc(wire::blood_crc(levels));
}

TEST(SessionCopy, hands_blood_on_and_believes_no_wrong_levels) {
  Session session;
  SessionCopy copy;
  take(copy, session.topology());
  auto first = session.frame(true);
  bleed(first, {}, {0, 7, 0});
  EXPECT_EQ(take(copy, first), News::Frame);
  auto second = session.frame(false);
  bleed(second, {0, 7, 0}, {1, 7, 200});
  EXPECT_EQ(take(copy, second), News::Frame);
  EXPECT_EQ(copy.newest()->blood, (wire::BloodLevels{1, 7, 200}));
  EXPECT_EQ(copy.newest()->blood_crc, wire::blood_crc(copy.newest()->blood));
  auto wrong = session.frame(false);
  bleed(wrong, {1, 7, 200}, {2, 7, 200});
  wrong.mutable_surface_frame()->set_blood_crc(1);
  EXPECT_EQ(take(copy, wrong), News::Nothing);
  EXPECT_TRUE(copy.needs_keyframe());
}

TEST(SessionCopy, follows_the_frames_and_says_which_it_has) {
  Session session;
  SessionCopy copy;
  EXPECT_FALSE(copy.has_frame());
  EXPECT_EQ(take(copy, session.topology()), News::NewSurface);
  EXPECT_EQ(take(copy, session.frame(true)), News::Frame);
  for (int i = 0; i < 80; ++i) EXPECT_EQ(take(copy, session.frame(false)), News::Frame);
  ASSERT_TRUE(copy.has_frame());
  EXPECT_EQ(copy.newest()->frame, session.number());
  EXPECT_EQ(copy.newest()->tick, 16 * session.number());
  EXPECT_EQ(copy.newest()->surface, session.surface());
  proto::FrameAck ack;
  copy.acknowledge(ack);
  EXPECT_EQ(ack.surface_crc(), wire::surface_crc(session.surface()));
}

TEST(SessionCopy, tells_who_comes_late_of_stage_pace_and_marks) {
  Session session;
  SessionCopy copy;
  take(copy, session.topology());
  Envelope stage, pace, marks, progress;
  stage.mutable_lesson_stage()->set_name("Search");
  pace.mutable_session_pace()->set_is_paused(true);
  marks.mutable_mark_list()->add_name("before");
  progress.mutable_lesson_progress()->set_progress(0.5f);
  for (const auto& message : {stage, pace, marks}) EXPECT_EQ(take(copy, message), News::Event);
  EXPECT_EQ(take(copy, progress), News::Fleeting);
  pace.mutable_session_pace()->set_is_paused(false);
  take(copy, pace);
  int stages = 0, paces = 0, lists = 0;
  for (const auto& framed : copy.all_but_frames()) {
    Envelope told;
    ASSERT_TRUE(wire::decode_envelope(BytesView(*framed).subspan(wire::kHeaderBytes), told).ok());
    stages += told.lesson_stage().name() == "Search";
    paces += told.has_session_pace() && !told.session_pace().is_paused();
    lists += told.mark_list().name_size() == 1;
    EXPECT_FALSE(told.has_lesson_progress());
  }
  EXPECT_EQ(stages, 1);
  EXPECT_EQ(paces, 1);
  EXPECT_EQ(lists, 1);
}

TEST(SessionCopy, keeps_the_fine_surface_part_by_part) {
  wire::FineSurface fine;
  for (std::int32_t v = 0; v < 9000; ++v) fine.quanta.push_back({v * 7919 % 100'003, v, 0});
  for (std::uint32_t t = 0; t + 2 < 9000; ++t) fine.triangles.push_back({t, t + 1, t + 2});
  std::vector<Envelope> messages;
  for (const auto& part : wire::parts_of(fine))
    *messages.emplace_back().mutable_fine_surface_part() = part;
  ASSERT_GE(messages.size(), 2u);
  const auto is_error = [](SessionCopy& copy, const Envelope& message) {
    return !copy.take(message, wire::encode_envelope(message)).ok();
  };
  SessionCopy copy, other;
  EXPECT_TRUE(is_error(other, messages[1])) << "it is not the first";
  wire::FineSurfaceAssembler late;
  bool is_whole = false;
  for (std::size_t i = 0; i < messages.size(); ++i) {
    EXPECT_FALSE(copy.has_all_fine_parts());
    EXPECT_EQ(take(copy, messages[i]), News::FinePart);
    ASSERT_EQ(copy.fine_parts().size(), i + 1);
    Envelope kept;
    const auto body = BytesView(*copy.fine_parts()[i]).subspan(wire::kHeaderBytes);
    ASSERT_TRUE(wire::decode_envelope(body, kept).ok());
    const auto added = late.add(kept.fine_surface_part());
    ASSERT_TRUE(added.ok());
    is_whole = *added;
  }
  ASSERT_TRUE(is_whole);
  EXPECT_TRUE(copy.has_all_fine_parts());
  EXPECT_EQ(late.take(), fine);
  EXPECT_TRUE(is_error(copy, messages[0])) << "it is told once";
  EXPECT_EQ(copy.fine_parts().size(), messages.size());
}

TEST(SessionCopy, asks_once_for_a_keyframe_when_it_has_lost_count) {
  Session session;
  SessionCopy copy;
  take(copy, session.topology());
  take(copy, session.frame(true));
  auto damaged = session.frame(false);
  damaged.mutable_surface_frame()->set_surface_crc(1);
  EXPECT_EQ(take(copy, damaged), News::Nothing);
  EXPECT_FALSE(copy.has_frame());
  EXPECT_TRUE(copy.needs_keyframe());
  EXPECT_FALSE(copy.needs_keyframe());
  EXPECT_EQ(take(copy, session.frame(false)), News::Nothing) << "its base is not known";
  EXPECT_FALSE(copy.needs_keyframe());
  EXPECT_EQ(take(copy, session.frame(true)), News::Frame);
  EXPECT_TRUE(copy.has_frame());
}

TEST(SessionCopy, refuses_a_surface_that_cannot_be) {
  SessionCopy copy;
  Envelope envelope;
  envelope.mutable_surface_topology()->add_triangle(7);
  EXPECT_FALSE(copy.take(envelope, wire::encode_envelope(envelope)).ok());
}

TEST(SessionCopy, a_new_surface_makes_old_frames_useless) {
  Session session;
  SessionCopy copy;
  take(copy, session.topology());
  take(copy, session.frame(true));
  take(copy, session.frame(false));
  take(copy, session.topology());
  EXPECT_FALSE(copy.has_frame());
  EXPECT_EQ(take(copy, session.frame(false)), News::Nothing) << "its base is of before";
}

TEST(SessionCopy, keeps_lists_and_lines_for_who_comes_late) {
  Session session;
  SessionCopy copy;
  take(copy, session.topology());
  Envelope people, line, more;
  people.mutable_participants()->add_participant()->set_name("Ann");
  line.mutable_drawing()->add_stroke()->set_participant(17);
  more.mutable_drawing()->add_stroke()->set_participant(18);
  more.mutable_drawing()->set_is_addition(true);
  EXPECT_EQ(take(copy, people), News::Event);
  take(copy, line);
  take(copy, more);
  int strokes = 0, lists = 0;
  for (const auto& framed : copy.all_but_frames()) {
    Envelope envelope;
    ASSERT_TRUE(
        wire::decode_envelope(BytesView(*framed).subspan(wire::kHeaderBytes), envelope).ok());
    strokes += envelope.drawing().stroke_size();
    lists += envelope.has_participants();
  }
  EXPECT_EQ(strokes, 2);
  EXPECT_EQ(lists, 1);
}

}  // namespace
}  // namespace trocar::follow
