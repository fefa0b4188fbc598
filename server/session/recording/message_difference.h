#pragma once

// Where a recorded message differs from the one that a simulation gives.

#include <optional>
#include <string>

namespace google::protobuf {
class Message;
}

namespace trocar::recording {

struct FieldDifference {
  std::string field, recorded, simulated;
};

// The first field that differs, or nothing. Both messages are of one type. is_older: the recording
// is of an older protocol, so that a field which only the simulation has is no difference.
std::optional<FieldDifference> first_difference(const google::protobuf::Message& recorded,
                                                const google::protobuf::Message& simulated,
                                                bool is_older);

}  // namespace trocar::recording
