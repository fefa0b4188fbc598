#pragma once

// The table says what the texts of a recording say of people, field by field of the schema. A test
// fails where a field of a recorded message is not in the table, and such a field counts as
// personal.

#include <cstdint>
#include <string_view>

namespace google::protobuf {
class Descriptor;
}

namespace trocar::recording {

enum class TextKind : std::uint8_t {
  Harmless,  // of the organ, the lesson's file, a device
  Name,      // one person's, and nothing else
  Sentence,  // a program's words, which may hold names
  Teaching,  // TeachEvent.text: likewise, and words that people typed
  Unlisted,
};

// field: its full name, "trocar.proto.Participant.name".
TextKind kind_of_text(std::string_view field);
// Whether such a message, or one that it can hold, has a text that is not harmless.
bool tells_of_people(const google::protobuf::Descriptor& message);

}  // namespace trocar::recording
