#include "server/session/recording/recorded_texts.h"

#include <google/protobuf/descriptor.h>

#include <algorithm>
#include <iterator>
#include <set>

namespace trocar::recording {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;

struct RecordedText {
  std::string_view field;
  TextKind kind;
};
constexpr RecordedText kTexts[] = {
    {"trocar.proto.BleedingRules.Vessel.name", TextKind::Harmless},
    {"trocar.proto.ClaimEvent.holder_name", TextKind::Name},
    {"trocar.proto.ClaimEvent.text", TextKind::Sentence},
    {"trocar.proto.HandReport.device", TextKind::Harmless},
    {"trocar.proto.LessonPicture.name", TextKind::Harmless},
    {"trocar.proto.LessonResult.line", TextKind::Sentence},
    {"trocar.proto.LessonResult.name", TextKind::Harmless},
    {"trocar.proto.LessonStage.hint", TextKind::Harmless},
    {"trocar.proto.LessonStage.name", TextKind::Harmless},
    {"trocar.proto.LessonStage.text", TextKind::Harmless},
    {"trocar.proto.LessonStage.title", TextKind::Harmless},
    {"trocar.proto.LessonText.source", TextKind::Harmless},
    {"trocar.proto.MaterialRegion.look", TextKind::Harmless},
    {"trocar.proto.MaterialRegion.name", TextKind::Harmless},
    {"trocar.proto.MeasuredMaterial.name", TextKind::Harmless},
    {"trocar.proto.Organ.name", TextKind::Harmless},
    {"trocar.proto.Organ.source", TextKind::Harmless},
    {"trocar.proto.Participant.frozen_by", TextKind::Name},
    {"trocar.proto.Participant.name", TextKind::Name},
    {"trocar.proto.Participants.waiting", TextKind::Name},
    {"trocar.proto.MeasuredMaterial.source", TextKind::Harmless},
    {"trocar.proto.SurfaceChange.region", TextKind::Harmless},
    {"trocar.proto.SurfaceTopology.organ_name", TextKind::Harmless},
    {"trocar.proto.TeachEvent.text", TextKind::Teaching},
    {"trocar.proto.ThreadRules.Thread.name", TextKind::Harmless},
    {"trocar.proto.TieBand.name", TextKind::Harmless},
};

bool tells(const Descriptor& message, std::set<const Descriptor*>& seen) {
  if (!seen.insert(&message).second) return false;
  for (int i = 0; i < message.field_count(); ++i) {
    const auto& field = *message.field(i);
    if (field.type() == FieldDescriptor::TYPE_STRING &&
        kind_of_text(field.full_name()) != TextKind::Harmless)
      return true;
    if (field.message_type() != nullptr && tells(*field.message_type(), seen)) return true;
  }
  return false;
}

}  // namespace

TextKind kind_of_text(std::string_view field) {
  const auto known = std::ranges::find(kTexts, field, &RecordedText::field);
  return known == std::end(kTexts) ? TextKind::Unlisted : known->kind;
}

bool tells_of_people(const Descriptor& message) {
  std::set<const Descriptor*> seen;
  return tells(message, seen);
}

}  // namespace trocar::recording
