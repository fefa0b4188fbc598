#pragma once

// Reader of the meshes in decks of Abaqus and CalculiX (.inp): *NODE and *ELEMENT of type C3D4.
// Sets of elements become regions (*ELEMENT, ELSET=; *ELSET) in the file's order, *NSET and sets of
// shells and trusses of three or two nodes become sets of nodes; other keywords are read over with
// their lines, which is said.
//
// Source: Abaqus keywords reference guide; Dhondt: CalculiX CrunchiX user's manual, chapter
// "Input deck format".

#include <string>
#include <string_view>

#include "common/base/result.h"
#include "server/organs/mesh/raw_tets.h"

namespace trocar::formats {

Result<mesh::RawTets> parse_abaqus(std::string_view text, const std::string& name);

}  // namespace trocar::formats
