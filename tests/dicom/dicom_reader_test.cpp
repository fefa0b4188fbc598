#include "server/organs/dicom/dicom_reader.h"

#include <dcmtk/dcmdata/dctk.h>
#include <gtest/gtest.h>

#include <fstream>
#include <functional>
#include <numeric>
#include <random>
#include <vector>

#include "tests/dicom/dicom_sample.h"
#include "tests/support/files.h"

namespace trocar::dicom {
namespace {

namespace fs = std::filesystem;
using namespace testing;  // NOLINT: the sample

class DicomReader : public ::testing::Test {
 protected:
  // Changes may end what would be right.
  fs::path segmentation(const std::function<void(DcmItem&)>& change = [](DcmItem&) {}) {
    return write("seg.dcm", [&](DcmItem& data) {
      make_segmentation(data);
      change(data);
    });
  }
  void series(
      int skipped = -1, const std::function<void(DcmItem&, int)>& change = [](DcmItem&, int) {}) {
    for (int k = 0; k < kSlices; ++k)
      if (k != skipped)
        write("s" + std::to_string(k * 3 % kSlices), [&](DcmItem& data) {
          make_slice(data, k);
          change(data, k);
        });
  }
  fs::path write(const std::string& name, const std::function<void(DcmItem&)>& make) {
    DcmFileFormat file;
    make(*file.getDataset());
    const auto path = folder_ / name;
    EXPECT_TRUE(file.saveFile(path.c_str(), EXS_LittleEndianExplicit).good());
    return path;
  }
  static std::string error_of(const fs::path& path) {
    const auto map = read_dicom(path);
    if (map.ok()) return "accepted";
    const std::string& text = map.error().message;
    return text.substr(text.rfind("/") == std::string::npos ? 0 : text.find(": ") + 2);
  }
  static void expect_phantom(const label_map::LabelMap& map, int from) {
    for (int k = 0; k < map.size[2]; ++k)
      for (int j = 0; j < kRows; ++j)
        for (int i = 0; i < kColumns; ++i)
          ASSERT_EQ(map.labels[map.index(i, j, k)], label_at(i, j, k + from)) << i << j << k;
    EXPECT_EQ(map.orientation, "LPS");
    // The patient's left, back and head are at x, -z and y here.
    EXPECT_NEAR(length(map.origin_m - Vec3d{0.010, 0.030 + 0.002 * from, -0.020}), 0, 1e-9);
    EXPECT_NEAR(length(map.steps_m[0] - Vec3d{0.001, 0, 0}), 0, 1e-9);
    EXPECT_NEAR(length(map.steps_m[1] - Vec3d{0, 0, -0.0015}), 0, 1e-9);
    EXPECT_NEAR(length(map.steps_m[2] - Vec3d{0, 0.002, 0}), 0, 1e-9);
  }

  void empty() {
    for (const auto& entry : fs::directory_iterator(folder_)) fs::remove(entry);
  }

  const trocar::testing::TemporaryFolder temporary_;
  const fs::path folder_ = fs::path(temporary_.file("a")).parent_path();
};

TEST_F(DicomReader, ReadsTheSegmentsOfASegmentationWithTheirNames) {
  const auto path = segmentation();
  EXPECT_TRUE(is_dicom(path));
  const auto map = read_dicom(path);
  ASSERT_TRUE(map.ok()) << map.error().message;
  EXPECT_EQ(map->size, (std::array{kColumns, kRows, 3}));
  expect_phantom(*map, 1);
  const std::vector<std::pair<std::uint16_t, std::string>> names{{1, "Liver"}, {2, "Tumour"}};
  EXPECT_EQ(map->names, names);
}

// The file says of which set of characters its texts are: Unicode, Latin, Cyrillic.
TEST_F(DicomReader, NamesOfSegmentsAreUtf8WhateverTheFilesSetIs) {
  const auto name_with = [&](const char* set, const std::string& bytes) {
    const auto map = read_dicom(segmentation([&](DcmItem& data) {
      if (set != nullptr) put(data, DCM_SpecificCharacterSet, set);
      put(*add(data, DCM_SegmentSequence, 0), DCM_SegmentLabel, bytes);
    }));
    EXPECT_TRUE(map.ok()) << map.error().message;
    return map.ok() ? map->names.front().second : "";
  };
  EXPECT_EQ(name_with("ISO_IR 192", "\u809d\u81d3"), "\u809d\u81d3");
  EXPECT_EQ(name_with("ISO_IR 100", "Gef\xe4\xdf"), "Gef\u00e4\u00df");
  EXPECT_EQ(name_with("ISO_IR 144", "\xdf\xd5\xe7\xd5\xdd\xec"),
            "\u043f\u0435\u0447\u0435\u043d\u044c");
  EXPECT_EQ(name_with("NONE OF THEM", "Gef\xe4\xdf"), "Gef\xe4\xdf");
  EXPECT_EQ(name_with(nullptr, "Liver"), "Liver");
}

TEST_F(DicomReader, ReadsAFolderOfLabelSlicesInWhateverOrder) {
  series();
  std::ofstream(folder_ / "notes.txt") << "no DICOM";
  const auto map = read_dicom(folder_);
  ASSERT_TRUE(map.ok()) << map.error().message;
  EXPECT_EQ(map->size, (std::array{kColumns, kRows, kSlices}));
  expect_phantom(*map, 0);
}

TEST_F(DicomReader, AVoxelOfTwoSegmentsBelongsToTheHigherAndThatIsSaid) {
  const auto path = segmentation([](DcmItem& data) {
    const Uint8* bits = nullptr;
    unsigned long count = 0;
    ASSERT_TRUE(data.findAndGetUint8Array(DCM_PixelData, bits, &count).good());
    std::vector<Uint8> all(count, 0xff);
    ASSERT_TRUE(data.putAndInsertUint8Array(DCM_PixelData, all.data(), count).good());
  });
  const auto map = read_dicom(path);
  ASSERT_TRUE(map.ok()) << map.error().message;
  EXPECT_EQ(std::ranges::count(map->labels, 2), kColumns * kRows * 3);
  ASSERT_EQ(map->warnings.size(), 1u);
  EXPECT_EQ(map->warnings[0], "segments overlap in 189 voxels, which the higher number has");
}

TEST_F(DicomReader, AFractionalSegmentIsInFromHalfItsGreatestValueOn) {
  const auto path = segmentation([](DcmItem& data) {
    put(data, DCM_SegmentationType, "FRACTIONAL");
    put(data, DCM_BitsAllocated, 8);
    put(data, DCM_MaximumFractionalValue, 200);
    std::vector<Uint8> all(kColumns * kRows * 6, 99);
    all[5] = 100;
    ASSERT_TRUE(data.putAndInsertUint8Array(DCM_PixelData, all.data(), all.size()).good());
  });
  const auto map = read_dicom(path);
  ASSERT_TRUE(map.ok()) << map.error().message;
  EXPECT_EQ(std::ranges::count(map->labels, 0), kColumns * kRows * 3 - 1);
  EXPECT_EQ(map->labels[5], 1);
}

TEST_F(DicomReader, AllFramesMayShareTheirSegment) {
  const auto path = segmentation([](DcmItem& data) {
    for (int f = 0; f < 6; ++f)
      delete add(data, DCM_PerFrameFunctionalGroupsSequence, f)
          ->remove(DCM_SegmentIdentificationSequence);
    put(*add(*add(data, DCM_SharedFunctionalGroupsSequence, 0), DCM_SegmentIdentificationSequence,
             0),
        DCM_ReferencedSegmentNumber, 2);
  });
  const auto map = read_dicom(path);
  ASSERT_TRUE(map.ok()) << map.error().message;
  EXPECT_EQ(std::ranges::count(map->labels, 1), 0);
  EXPECT_GT(std::ranges::count(map->labels, 2), 0);
}

TEST_F(DicomReader, FramesOfOtherDirectionsAreRefused) {
  EXPECT_EQ(error_of(segmentation([](DcmItem& data) {
              put(*add(*add(data, DCM_PerFrameFunctionalGroupsSequence, 3),
                       DCM_PlaneOrientationSequence, 0),
                  DCM_ImageOrientationPatient, "0\\1\\0\\1\\0\\0");
            })),
            "frame 4: has other directions or distances than the first one");
}

TEST_F(DicomReader, PixelsOfALabelMapSegmentationAreTheNumbersOfSegments) {
  const auto label_map = [&](int label) {
    return segmentation([&](DcmItem& data) {
      put(data, DCM_SOPClassUID, "1.2.840.10008.5.1.4.1.1.66.7");
      put(data, DCM_SegmentationType, "LABELMAP");
      for (const auto& key : {DCM_BitsAllocated, DCM_BitsStored}) put(data, key, 8);
      put(data, DCM_HighBit, 7);
      put(data, DCM_PixelRepresentation, 0);
      for (int f = 5; f >= 3; --f) {
        DcmSequenceOfItems* frames = nullptr;
        ASSERT_TRUE(data.findAndGetSequence(DCM_PerFrameFunctionalGroupsSequence, frames).good());
        delete frames->remove(static_cast<unsigned long>(f));
      }
      std::vector<Uint8> all(kColumns * kRows * 3, 0);
      all[7] = static_cast<Uint8>(label);
      ASSERT_TRUE(data.putAndInsertUint8Array(DCM_PixelData, all.data(), all.size()).good());
    });
  };
  const auto map = read_dicom(label_map(2));
  ASSERT_TRUE(map.ok()) << map.error().message;
  EXPECT_EQ(map->labels[7], 2);
  EXPECT_EQ(std::ranges::count(map->labels, 0), kColumns * kRows * 3 - 1);
  EXPECT_EQ(map->names.size(), 2u);
  EXPECT_EQ(error_of(label_map(9)), "frame 1: there is no segment 9");
}

TEST_F(DicomReader, OnlyTheBitsThatAreStoredCount) {
  const auto with = [&](Uint16 pixel, int stored, int high, int sign) {
    empty();
    series(-1, [&](DcmItem& data, int) {
      put(data, DCM_BitsStored, stored);
      put(data, DCM_HighBit, high);
      put(data, DCM_PixelRepresentation, sign);
      std::vector<Uint16> pixels(kColumns * kRows, 0);
      pixels[4] = pixel;
      ASSERT_TRUE(data.putAndInsertUint16Array(DCM_PixelData, pixels.data(), pixels.size()).good());
    });
    const auto map = read_dicom(folder_);
    return map.ok() ? std::to_string(map->labels[4]) : error_of(folder_);
  };
  EXPECT_EQ(with(0x1002, 12, 11, 0), "2");
  EXPECT_EQ(with(0x0025, 12, 15, 0), "2");
  EXPECT_EQ(with(0x0fff, 12, 11, 0), "4095");
  EXPECT_EQ(with(2, 16, 15, 1), "2");
  EXPECT_EQ(with(0x0fff, 12, 11, 1),
            "pixel (4, 0) is -1, which is no label: labels are whole numbers from 0 to 65535");
  EXPECT_EQ(with(2, 17, 16, 0), "BitsStored is 17, must be 1 to 16");
  EXPECT_EQ(with(2, 12, 16, 0), "HighBit is 16, must be 11 to 15");
}

TEST_F(DicomReader, SaysWhatIsWrongWithASegmentation) {
  const auto error = [&](const std::function<void(DcmItem&)>& change) {
    return error_of(segmentation(change));
  };
  EXPECT_EQ(error([](DcmItem& d) { delete d.remove(DCM_PixelData); }), "PixelData is missing");
  EXPECT_EQ(error([](DcmItem& d) { delete d.remove(DCM_SegmentSequence); }),
            "SegmentSequence is empty");
  EXPECT_EQ(error([](DcmItem& d) { put(d, DCM_Rows, 8); }),
            "PixelData has 48 bytes, 54 are needed: it is cut off");
  EXPECT_EQ(error([](DcmItem& d) { put(d, DCM_Columns, 0); }), "Columns is 0, must be 1 to 65535");
  EXPECT_EQ(error([](DcmItem& d) { put(d, DCM_SegmentationType, "OTHER"); }),
            "SegmentationType is none of BINARY, FRACTIONAL, LABELMAP");
  EXPECT_EQ(error([](DcmItem& d) {
              put(*add(*add(d, DCM_PerFrameFunctionalGroupsSequence, 2),
                       DCM_SegmentIdentificationSequence, 0),
                  DCM_ReferencedSegmentNumber, 7);
            }),
            "frame 3: there is no segment 7");
  EXPECT_EQ(
      error([](DcmItem& d) {
        put(*add(*add(d, DCM_SharedFunctionalGroupsSequence, 0), DCM_PlaneOrientationSequence, 0),
            DCM_ImageOrientationPatient, "1\\0\\0\\0.5\\0.5\\0");
      }),
      "its axes are skewed: resample it at right angles");
}

TEST_F(DicomReader, SaysWhatIsWrongWithASeries) {
  EXPECT_EQ(error_of(folder_), "holds no DICOM file");
  series(2);
  EXPECT_EQ(error_of(folder_), "a slice is missing between 32.00 and 36.00 mm");
  empty();
  series(-1, [](DcmItem& data, int k) {
    if (k == 3) put(data, DCM_SeriesInstanceUID, "1.2.9");
  });
  EXPECT_EQ(error_of(folder_), "is of another series than the files before: give each a folder");
  empty();
  series(-1, [](DcmItem& data, int) { put(data, DCM_RescaleIntercept, "-1024"); });
  EXPECT_NE(error_of(folder_).find("it holds grey values, not labels"), std::string::npos);
  empty();
  series(-1, [](DcmItem& data, int k) {
    std::vector<Uint16> greys(kColumns * kRows);
    std::iota(greys.begin(), greys.end(), static_cast<Uint16>(k * kColumns * kRows));
    ASSERT_TRUE(data.putAndInsertUint16Array(DCM_PixelData, greys.data(), greys.size()).good());
  });
  EXPECT_EQ(error_of(folder_),
            "has more than 256 values: it holds grey values, not labels, so "
            "segment it first, in 3D Slicer for instance");
  empty();
  series(-1, [](DcmItem& data, int k) { put(data, DCM_ImagePositionPatient, place(k / 2)); });
  EXPECT_EQ(error_of(folder_), "5 slices stand at 3 positions: it is more than one series");
  empty();
  write("one", [](DcmItem& data) { make_slice(data, 0); });
  EXPECT_EQ(error_of(folder_ / "one"),
            "is one image: import the folder of its series, or a segmentation");
}

// Each of these ends in a map or in one line.
TEST_F(DicomReader, ChangedBytesAreRefusedOrRead) {
  const auto path = segmentation();
  std::ifstream in(path, std::ios::binary);
  const std::string right((std::istreambuf_iterator<char>(in)), {});
  std::mt19937 random(5);
  int read = 0, refused = 0;
  for (int n = 0; n < 400; ++n) {
    std::string bytes = right;
    for (int i = 0; i < 1 + n % 4; ++i)
      bytes[132 + random() % (bytes.size() - 132)] = static_cast<char>(random());
    if (n % 5 == 0) bytes.resize(132 + random() % (bytes.size() - 132));
    std::ofstream(path, std::ios::binary) << bytes;
    const auto map = read_dicom(path);
    if (map.ok()) {
      ++read;
    } else {
      ++refused;
      EXPECT_EQ(map.error().message.find('\n'), std::string::npos);
    }
  }
  EXPECT_GT(read, 20);
  EXPECT_GT(refused, 100);
}

}  // namespace
}  // namespace trocar::dicom
