#pragma once

// Reader of label maps in DICOM, for files that nobody vouches for: a segmentation (one file, whose
// segments become labels with their numbers and names), or a folder with one series of slices whose
// pixels are labels.
//
// Pixels of a label map segmentation are the numbers of their segments. A binary segment has a
// voxel where its bit is set, a fractional one from half of its greatest value on. Where segments
// overlap, the one with the higher number has the voxel, which is said. Slices of a segmentation
// that are not there are empty; in a series none may be missing. Pixels must not be compressed.
// Errors are one line with the file's name and the attribute. Memory: at most 512 MiB for the
// labels.
//
// Source: DICOM PS3.3 A.51 and C.8.20 (segmentation), C.7.6.2 (image plane). Files are taken apart
// by DCMTK.

#include <filesystem>

#include "common/base/result.h"
#include "server/organs/label_map/label_map.h"

namespace trocar::dicom {

// Whether it is a folder, or a file that begins as a DICOM file does.
bool is_dicom(const std::filesystem::path& path);

Result<label_map::LabelMap> read_dicom(const std::filesystem::path& path);

}  // namespace trocar::dicom
