#include "server/session/replication/audience.h"

#include "proto/wire.pb.h"

namespace trocar::replication {

void SessionContext::record(wire::LessonKind kind,
                            const google::protobuf::MessageLite& message) const {
  if (!options.on_lesson) return;
  wire::LessonEntry entry{kind, Bytes(message.ByteSizeLong())};
  message.SerializeToArray(entry.message.data(), static_cast<int>(entry.message.size()));
  options.on_lesson(std::move(entry));
}

void SessionContext::refuse(const Speaker& who, const std::string& why) const {
  proto::Envelope answer;
  auto& event = *answer.mutable_teach_event();
  event.set_tick(audience.newest_tick());
  event.set_by(who.participant->slot.value);
  event.set_text(why);
  audience.send(who, wire::encode_envelope(answer));
}

}  // namespace trocar::replication
