#pragma once

// A measured material in a TOML file of its own, as trocar-organ identify leaves it: one table
//
//   [hyperelastic]
//   name = "specimen 3"
//   form = "unsplit"                    # or "isochoric"
//   c_i0_pa = [883.8, 1707.9]           # C10 first, at most five
//   exponent = 2.5                      # b of an exponential law, of which c_i0_pa is C10 alone
//   bulk_modulus_pa = 35352
//   weights = [0.5054, 0.1485]          # g_k and
//   relaxation_times_s = [0.5784, 6.9]  # tau_k: as many, at most four, or none
//
// Checked like the materials that ship with Trocar. Error: file, line, key, what is wrong.

#include <filesystem>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "server/organs/material/hyperelastic_material.h"

namespace trocar::material {

Result<HyperelasticMaterial> read_material_file(const std::filesystem::path& path);
// `source` stands for the file's path in messages.
Result<HyperelasticMaterial> parse_material_text(std::string_view text, std::string_view source);

// Returns the material that an option --material names: one that ships with Trocar, or a file whose
// name ends in .toml.
Result<HyperelasticMaterial> measured_material(const std::string& name_or_file);

}  // namespace trocar::material
