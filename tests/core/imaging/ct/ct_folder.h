// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <Eigen/Core>

#include "core/imaging/ct/ct_volume_reader.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {

// A DICOM file (explicit VR, little endian) written element by element, so that tests know every
// byte of it and can leave out or spoil any.
class DicomFile {
 public:
  enum Tag : uint32_t {
    kSopClass = 0x00080016,
    kImageType = 0x00080008,
    kSeriesTime = 0x00080031,
    kAcquisitionTime = 0x00080032,
    kContentTime = 0x00080033,
    kModality = 0x00080060,
    kPatientName = 0x00100010,
    kPatientId = 0x00100020,
    kKernel = 0x00181210,
    kStudyUid = 0x0020000d,
    kAcquisitionNumber = 0x00200012,
    kFrameOfReference = 0x00200052,
    kSeriesUid = 0x0020000e,
    kSeriesNumber = 0x00200011,
    kInstanceNumber = 0x00200013,
    kPosition = 0x00200032,
    kOrientation = 0x00200037,
    kSamplesPerPixel = 0x00280002,
    kPhotometric = 0x00280004,
    kNumberOfFrames = 0x00280008,
    kRows = 0x00280010,
    kColumns = 0x00280011,
    kPixelSpacing = 0x00280030,
    kRescaleIntercept = 0x00281052,
    kRescaleSlope = 0x00281053,
    kSharedGroups = 0x52009229,
    kFrameGroups = 0x52009230,
    kPixelData = 0x7fe00010,
  };

  DicomFile& Text(uint32_t tag, const std::string& vr, const std::string& value);
  DicomFile& Short(uint32_t tag, uint16_t value);
  DicomFile& Pixels(const std::vector<uint16_t>& values);
  // A sequence; of an item only its elements count.
  DicomFile& Sequence(uint32_t tag, const std::vector<DicomFile>& items);
  DicomFile& Erase(uint32_t tag);

  std::string Bytes() const;

 private:
  struct Element {
    std::string vr;
    std::string value;
  };
  std::string Elements() const;

  std::map<uint32_t, Element> elements_;
};

// How the slices of a synthetic series lie.
struct SeriesGeometry {
  int columns = 12;
  int rows = 10;
  int slices = 9;
  Eigen::Vector2d pixel_spacing_mm = {0.75, 0.5};  // between rows, between columns
  Eigen::Vector3d origin_mm = {-30, 20, 100};
  Eigen::Vector3d row_direction = {1, 0, 0};
  Eigen::Vector3d column_direction = {0, 1, 0};
  Eigen::Vector3d step_mm = {0, 0, 1.25};  // from one slice to the next
};

// A patient with a part of air, and whose HU elsewhere grow with x, y and z by different
// numbers; whole numbers nowhere near -1024.
double PhantomHu(const Eigen::Vector3d& position_mm);

// The slices of the phantom as a scanner would write them: stored values are HU + 1024.
std::vector<DicomFile> PhantomSeries(const SeriesGeometry& geometry = {});

// Slices of the phantom, by number, as the frames of one file of Enhanced CT. Their pixel spacing,
// orientation and rescale stand in the shared functional groups, or in those of each frame.
// `acquisitions`: FrameAcquisitionNumber of each frame; empty: left out.
DicomFile EnhancedPhantom(const SeriesGeometry& geometry, const std::vector<int>& slices,
                          bool shared, const std::vector<uint16_t>& acquisitions = {});

// A volume as the slices of a scanner: stored values are HU + 1024. Rows and columns lie as the
// volume's first two axes.
std::vector<DicomFile> SeriesOf(const CtVolume& volume);

// The bundled head, tests/data/ct/headsq.
absl::StatusOr<CtVolume> ReadBundledHead();

// A folder of its own for every test.
class CtFolder : public ::testing::Test {
 protected:
  void SetUp() override;
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string Path(const std::string& name = "") const { return (folder_ / name).string(); }
  void Write(const std::string& name, const std::string& contents) const;

  // Files "<prefix>000", "<prefix>001", ... The names lie about the order: the first one is last.
  void WriteSeries(const std::vector<DicomFile>& series, const std::string& prefix = "slice") const;

  // Reads the folder; nothing may appear on stderr, and no error may hold what the patient is
  // called.
  absl::StatusOr<CtVolume> Read(const CtReadOptions& options = {},
                                const std::string& name = "") const;

  std::filesystem::path folder_;
};

// Largest difference between the volume's voxels and the phantom at the places where it says that
// they lie.
double WorstPhantomError(const CtVolume& volume);

}  // namespace tissueform::testing
