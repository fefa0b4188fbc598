#pragma once

// A small segmentation and a slice of labels in DICOM, which tests change.

#include <dcmtk/dcmdata/dctk.h>

#include <string>
#include <vector>

#include "common/base/assert.h"

namespace trocar::dicom::testing {

inline constexpr int kColumns = 9, kRows = 7, kSlices = 5;

// Label 1 fills a box, label 2 a smaller one in it.
inline int label_at(int i, int j, int k) {
  const bool is_in = i > 0 && i < 8 && j > 0 && j < 6 && k > 0 && k < 4;
  return is_in ? i == 4 && j > 2 ? 2 : 1 : 0;
}

inline void put(DcmItem& item, const DcmTagKey& key, const std::string& text) {
  TROCAR_ASSERT(item.putAndInsertString(key, text.c_str()).good());
}
inline void put(DcmItem& item, const DcmTagKey& key, int value) {
  TROCAR_ASSERT(item.putAndInsertUint16(key, static_cast<Uint16>(value)).good());
}
inline DcmItem* add(DcmItem& item, const DcmTagKey& sequence, long at) {
  DcmItem* added = nullptr;
  TROCAR_ASSERT(item.findOrCreateSequenceItem(sequence, added, at).good());
  return added;
}
inline std::string place(int k) {
  return "10\\20\\" + std::to_string(30 + 2 * k);
}

inline void put_image(DcmItem& data, const char* kind) {
  put(data, DCM_SOPClassUID, kind);
  put(data, DCM_SOPInstanceUID, "1.2.3.4");
  put(data, DCM_Rows, kRows);
  put(data, DCM_Columns, kColumns);
  put(data, DCM_SamplesPerPixel, 1);
}

// Slices without a voxel are left out, as programs do.
inline void make_segmentation(DcmItem& data) {
  put_image(data, UID_SegmentationStorage);
  put(data, DCM_SegmentationType, "BINARY");
  put(data, DCM_BitsAllocated, 1);
  for (int n = 1; n <= 2; ++n) {
    auto* segment = add(data, DCM_SegmentSequence, n - 1);
    put(*segment, DCM_SegmentNumber, n);
    put(*segment, DCM_SegmentLabel, n == 1 ? "Liver" : "Tumour");
  }
  auto* shared = add(data, DCM_SharedFunctionalGroupsSequence, 0);
  put(*add(*shared, DCM_PlaneOrientationSequence, 0), DCM_ImageOrientationPatient,
      "1\\0\\0\\0\\1\\0");
  auto* measures = add(*shared, DCM_PixelMeasuresSequence, 0);
  put(*measures, DCM_PixelSpacing, "1.5\\1");
  put(*measures, DCM_SpacingBetweenSlices, "2");
  std::vector<Uint8> bits;
  std::size_t at = 0;
  long frames = 0;
  for (int n = 1; n <= 2; ++n)
    for (int k = 1; k < 4; ++k) {
      auto* frame = add(data, DCM_PerFrameFunctionalGroupsSequence, frames++);
      put(*add(*frame, DCM_PlanePositionSequence, 0), DCM_ImagePositionPatient, place(k));
      put(*add(*frame, DCM_SegmentIdentificationSequence, 0), DCM_ReferencedSegmentNumber, n);
      for (int j = 0; j < kRows; ++j)
        for (int i = 0; i < kColumns; ++i, ++at) {
          if (at % 8 == 0) bits.push_back(0);
          if (label_at(i, j, k) == n) bits.back() = static_cast<Uint8>(bits.back() | 1 << (at % 8));
        }
    }
  bits.resize(bits.size() + bits.size() % 2);
  TROCAR_ASSERT(data.putAndInsertUint8Array(DCM_PixelData, bits.data(), bits.size()).good());
}

inline void make_slice(DcmItem& data, int k) {
  put_image(data, UID_CTImageStorage);
  put(data, DCM_SeriesInstanceUID, "1.2.3");
  put(data, DCM_BitsAllocated, 16);
  put(data, DCM_ImageOrientationPatient, "1\\0\\0\\0\\1\\0");
  put(data, DCM_ImagePositionPatient, place(k));
  put(data, DCM_PixelSpacing, "1.5\\1");
  std::vector<Uint16> pixels;
  for (int j = 0; j < kRows; ++j)
    for (int i = 0; i < kColumns; ++i) pixels.push_back(static_cast<Uint16>(label_at(i, j, k)));
  TROCAR_ASSERT(data.putAndInsertUint16Array(DCM_PixelData, pixels.data(), pixels.size()).good());
}

}  // namespace trocar::dicom::testing
