#pragma once

// Reader of label maps in NIfTI files (.nii, .nii.gz), for files that nobody vouches for.
//
// One volume of whole numbers from 0 to 65535, unscaled, of at most kMaxLabels values beside 0. The
// stored type is an integer of 8 to 32 bits, a signed one of 64, or a float. The place of its
// voxels is that of the sform, else of the qform, else of the voxel sizes alone, which is said, as
// it is where sform and qform disagree. The file's coordinates run to the patient's right, front
// and head (RAS). Errors are one line with the file's name and the header's field. Memory grows
// with the bytes that are there, to 512 MiB at most.
//
// Source: Cox et al.: A (sort of) new image data format standard: NIfTI-1, 2004; nifti1.h and
// nifti2.h.

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "server/organs/label_map/label_map.h"
#include "server/organs/mesh/raw_tets.h"

namespace trocar::label_map {

// Whether a name ends with .nii or .nii.gz.
bool is_nifti_file(const std::filesystem::path& path);

// unit: as somebody says it; error where the file says another. Without, and without one in the
// file, it is the millimetre, with a warning.
Result<LabelMap> read_nifti(const std::filesystem::path& path, std::optional<mesh::Unit> unit);
// The same from memory, packed by gzip or not; `name` stands for the path in errors.
Result<LabelMap> parse_nifti(std::string_view bytes, std::optional<mesh::Unit> unit,
                             const std::string& name);

}  // namespace trocar::label_map
