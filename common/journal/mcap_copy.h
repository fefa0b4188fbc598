#pragma once

// Copies a recording, message by message, into a new whole file with index and summary.

#include <functional>
#include <string>

#include "common/base/result.h"
#include "common/journal/mcap_reader.h"

namespace trocar::journal {

// Gives the bytes to write in place of a message's; they are valid until the next call.
using MessageChange = std::function<Result<BytesView>(const McapChannel&, const McapMessage&)>;

using MetadataChange = std::function<McapMetadata(McapMetadata)>;

// Metadata are copied, as `change_metadata` gives them back, and `note` follows them. `to` must not
// exist, and gets its name when it is whole. Damaged chunks are left out and counted; the error is
// that of writing, or of `change`.
Result<ReadReport> copy_recording(McapReader& reader, const std::string& to,
                                  const MessageChange& change, const McapMetadata& note,
                                  const MetadataChange& change_metadata = std::identity());

}  // namespace trocar::journal
