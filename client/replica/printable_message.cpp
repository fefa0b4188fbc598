#include "client/replica/printable_message.h"

#include "common/base/printable.h"
#include "proto/wire.pb.h"

namespace trocar::replica {
namespace {

void mend(std::string* text) {
  if (!is_printable(*text)) *text = printable(*text);
}

}  // namespace

void make_printable(proto::Envelope& message) {
  switch (message.message_case()) {
    case proto::Envelope::kGoodbye:
      return mend(message.mutable_goodbye()->mutable_text());
    case proto::Envelope::kMarkEvent:
      mend(message.mutable_mark_event()->mutable_name());
      return mend(message.mutable_mark_event()->mutable_text());
    case proto::Envelope::kMarkList:
      for (auto& name : *message.mutable_mark_list()->mutable_name()) mend(&name);
      return;
    case proto::Envelope::kSessionPace:
      return mend(message.mutable_session_pace()->mutable_by());
    case proto::Envelope::kTeachEvent:
      return mend(message.mutable_teach_event()->mutable_text());
    case proto::Envelope::kLessonStage: {
      auto& stage = *message.mutable_lesson_stage();
      for (auto* text : {stage.mutable_title(), stage.mutable_name(), stage.mutable_text(),
                         stage.mutable_hint()})
        mend(text);
      for (auto& result : *stage.mutable_result()) {
        mend(result.mutable_name());
        for (auto& line : *result.mutable_line()) mend(&line);
      }
      return;
    }
    case proto::Envelope::kRecordingState:
      return mend(message.mutable_recording_state()->mutable_text());
    case proto::Envelope::kSurfaceTopology:
      return mend(message.mutable_surface_topology()->mutable_organ_name());
    case proto::Envelope::kClaimEvent:
      mend(message.mutable_claim_event()->mutable_holder_name());
      return mend(message.mutable_claim_event()->mutable_text());
    case proto::Envelope::kSurfaceChange:
      for (auto& region : *message.mutable_surface_change()->mutable_region()) mend(&region);
      return;
    case proto::Envelope::kParticipants:
      for (auto& participant : *message.mutable_participants()->mutable_participant()) {
        mend(participant.mutable_name());
        mend(participant.mutable_frozen_by());
      }
      return;
    default:
      return;  // it carries no text
  }
}

}  // namespace trocar::replica
