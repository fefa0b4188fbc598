#pragma once

// MCAP's "protobuf" encoding wants this in a schema: a serialised FileDescriptorSet from which any
// reader can decode the message, files in order of dependency.
//
// Only the messages and enums that the message can contain are in it: each chunk of a journal
// repeats its schemas, and the whole of wire.proto in each would outweigh the data.

#include <string>

#include "common/base/bytes.h"

namespace google::protobuf {
class Descriptor;
}

namespace trocar::journal {

inline constexpr const char* kProtobufEncoding = "protobuf";

// Deterministic: equal descriptors give equal bytes.
Bytes schema_bytes(const google::protobuf::Descriptor& message);
// Returns the full name without a leading dot.
std::string schema_name(const google::protobuf::Descriptor& message);

}  // namespace trocar::journal
