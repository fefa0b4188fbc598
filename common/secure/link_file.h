#pragma once

// The link file: the codes of all roles of a server on this machine, so that its user need not type
// them. PORT.json in the first of link_folders() that can be had, mode 0600; the server removes it
// at its end.

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>

#include "common/base/result.h"
#include "common/secure/join_code.h"

namespace trocar::secure {

using CodesByRole = std::map<std::string, JoinCode>;  // by the role's name

// Returns where it is.
Result<std::filesystem::path> write_link_file(std::uint16_t port, const CodesByRole& codes);
// The code for a role at the server at that port of this machine.
Result<JoinCode> read_link_file(std::uint16_t port, const std::string& role);

}  // namespace trocar::secure
