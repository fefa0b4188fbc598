#pragma once

// Reads what a recording shows, for comparisons.

#include <map>
#include <string>
#include <vector>

#include "common/base/tick.h"
#include "proto/journal.pb.h"

namespace trocar::recording::testing {

// CRC of the surface in each frame, decoded from whatever it was recorded as.
std::map<Tick, std::uint32_t> surfaces_of(const std::string& path);
std::vector<proto::Overview> overviews_of(const std::string& path);

}  // namespace trocar::recording::testing
