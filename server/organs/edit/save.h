#pragma once

// Saving of an edited organ, never over another file unasked.

#include <filesystem>
#include <string>

#include "common/base/result.h"
#include "server/organs/organ/organ.h"

namespace trocar::edit {

enum class Replace { Refuse, Allow };

// Writes an .organ file. Error: the name does not end with .organ, the file is there and Refuse is
// said (ErrorCode::Refused), or it cannot be written. The file is whole or not there.
Status save(const organ::Organ& organ, const std::filesystem::path& path, Replace replace);

// Returns a name beside which nothing is lost: "<stem>.organ" of what was opened, or, where such a
// file is there, "<stem>-edited.organ", "<stem>-edited-2.organ" and so on, in the current folder.
std::filesystem::path free_name(const std::string& opened);

}  // namespace trocar::edit
