#pragma once

// Copies a recording, message by message, into a new whole file with index and summary.

#include <functional>
#include <optional>
#include <string>

#include "common/base/result.h"
#include "common/journal/mcap_reader.h"
#include "common/secure/signing.h"

namespace trocar::journal {

// Gives the bytes to write in place of a message's; they are valid until the next call.
using MessageChange = std::function<Result<BytesView>(const McapChannel&, const McapMessage&)>;

using MetadataChange = std::function<McapMetadata(McapMetadata)>;

struct CopyOptions {
  MessageChange change;                              // empty: messages stay as they are
  MetadataChange change_metadata = std::identity();  // says what to write in place of metadata
  std::optional<McapMetadata> note;                  // follows them
  const secure::SigningKey* key = nullptr;           // null: the copy is not signed
};

// A copy of a session has an end of its own; a signature is not copied. `to` must not exist, and
// gets its name when it is whole. Damaged chunks are left out and counted; the error is that of
// writing, or of `change`.
Result<ReadReport> copy_recording(McapReader& reader, const std::string& to,
                                  const CopyOptions& options);

}  // namespace trocar::journal
