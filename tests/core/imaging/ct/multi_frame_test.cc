// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// A whole scan in one file: Enhanced CT, and the plain CT class with several frames.

#include <gdcmImageChangeTransferSyntax.h>
#include <gdcmImageReader.h>
#include <gdcmWriter.h>
#include <random>
#include <string>
#include <vector>

#include "tests/core/imaging/ct/ct_folder.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using tissueform::testing::CtFolder;
using tissueform::testing::DicomFile;
using tissueform::testing::EnhancedPhantom;
using tissueform::testing::SeriesGeometry;
using tissueform::testing::StatusIs;
using tissueform::testing::WorstPhantomError;

using ::tissueform::testing::kInvalid;

constexpr uint32_t kSliceThickness = 0x00180050;
constexpr uint32_t kSpacingBetweenSlices = 0x00180088;

class MultiFrameTest : public CtFolder {};

TEST_F(MultiFrameTest, FramesLieWhereTheirFunctionalGroupsSay) {
  for (const bool shared : {true, false}) {
    const SeriesGeometry geometry;
    Write("ct", EnhancedPhantom(geometry, {8, 7, 6, 5, 0, 1, 2, 3, 4}, shared).Bytes());
    ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
    EXPECT_THAT(volume.size, ElementsAre(12, 10, 9));
    EXPECT_TRUE(volume.spacing_mm.isApprox(Eigen::Vector3d(0.5, 0.75, 1.25), 1e-9));
    EXPECT_TRUE(volume.origin_mm.isApprox(Eigen::Vector3d(-30, 20, 100), 1e-9));
    EXPECT_EQ(WorstPhantomError(volume), 0);
    EXPECT_EQ(volume.provenance.num_files, 1);
    EXPECT_THAT(volume.provenance.notes, IsEmpty());
    ASSERT_OK_AND_ASSIGN(const CtVolume by_file, Read({}, "ct"));
    EXPECT_EQ(by_file.hu, volume.hu);
  }
}

TEST_F(MultiFrameTest, ScanMayBeSpreadOverSeveralFiles) {
  const SeriesGeometry geometry;
  Write("a", EnhancedPhantom(geometry, {0, 2, 4, 6, 8}, true).Bytes());
  Write("b", EnhancedPhantom(geometry, {1, 3, 5, 7}, true).Bytes());
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
  EXPECT_EQ(volume.size[2], 9);
  EXPECT_EQ(WorstPhantomError(volume), 0);
  EXPECT_EQ(volume.provenance.num_files, 2);
}

// Two scans of the same places, which only the number of the acquisition distinguishes.
TEST_F(MultiFrameTest, ScansOfOneFileAreSeparatedByTheirAcquisitionNumbers) {
  const auto phantom = [](int in_second_scan) {
    std::vector<int> slices = {0, 1, 2, 3, 4, 5, 6, 7, 8};
    std::vector<uint16_t> acquisitions(slices.size(), 1);
    for (int slice = 0; slice < in_second_scan; ++slice) {
      slices.push_back(slice);
      acquisitions.push_back(2);
    }
    return EnhancedPhantom({}, slices, true, acquisitions).Bytes();
  };
  Write("ct", phantom(1));
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
  EXPECT_THAT(volume.size, ElementsAre(12, 10, 9));
  EXPECT_EQ(WorstPhantomError(volume), 0);
  Write("ct", phantom(8));
  EXPECT_THAT(Read(), StatusIs(kInvalid, AllOf(HasSubstr("(8 slices)"), HasSubstr("(9 slices)"),
                                               HasSubstr("export one scan as a file of its own"))));
}

// As cone-beam devices write it: plain CT class, geometry at the top level only.
DicomFile PlainPhantom() {
  DicomFile file = EnhancedPhantom({}, {0, 1, 2, 3, 4, 5, 6, 7, 8}, true);
  file.Erase(DicomFile::kFrameGroups)
      .Erase(DicomFile::kSharedGroups)
      .Text(DicomFile::kSopClass, "UI", "1.2.840.10008.5.1.4.1.1.2")
      .Text(DicomFile::kPosition, "DS", "-30\\20\\100")
      .Text(DicomFile::kOrientation, "DS", "1\\0\\0\\0\\1\\0")
      .Text(DicomFile::kPixelSpacing, "DS", "0.75\\0.5")
      .Text(DicomFile::kRescaleIntercept, "DS", "-1024")
      .Text(DicomFile::kRescaleSlope, "DS", "1")
      .Text(kSpacingBetweenSlices, "DS", "1.25");
  return file;
}

TEST_F(MultiFrameTest, FramesOfThePlainClassAreEvenlySpaced) {
  Write("ct", PlainPhantom().Bytes());
  const auto expect_phantom = [](const CtVolume& volume) {
    EXPECT_THAT(volume.size, ElementsAre(12, 10, 9));
    EXPECT_TRUE(volume.spacing_mm.isApprox(Eigen::Vector3d(0.5, 0.75, 1.25), 1e-9));
    EXPECT_EQ(WorstPhantomError(volume), 0);
    EXPECT_THAT(volume.provenance.notes,
                ElementsAre(AllOf(HasSubstr("its 9 frames are placed by SpacingBetweenSlices"),
                                  HasSubstr("upside down"))));
  };
  ASSERT_OK_AND_ASSIGN(const CtVolume plain, Read());
  expect_phantom(plain);
  gdcm::ImageReader reader;
  reader.SetFileName(Path("ct").c_str());
  ASSERT_TRUE(reader.Read());
  gdcm::ImageChangeTransferSyntax change;
  change.SetTransferSyntax(gdcm::TransferSyntax::JPEGLosslessProcess14_1);
  change.SetInput(reader.GetImage());
  ASSERT_TRUE(change.Change());
  // Not by ImageWriter, which makes another class of it.
  reader.GetFile().GetDataSet().Replace(change.GetOutput().GetDataElement());
  const std::string syntax = "1.2.840.10008.1.2.4.70";
  gdcm::DataElement element(gdcm::Tag(0x0002, 0x0010));
  element.SetVR(gdcm::VR::UI);
  element.SetByteValue(syntax.data(), static_cast<uint32_t>(syntax.size()));
  reader.GetFile().GetHeader().Replace(element);
  reader.GetFile().GetHeader().SetDataSetTransferSyntax(
      gdcm::TransferSyntax::JPEGLosslessProcess14_1);
  gdcm::Writer writer;
  writer.CheckFileMetaInformationOff();
  writer.SetFile(reader.GetFile());
  writer.SetFileName(Path("ct").c_str());
  ASSERT_TRUE(writer.Write());
  ASSERT_OK_AND_ASSIGN(const CtVolume compressed, Read());
  expect_phantom(compressed);
}

// SliceThickness counts only where SpacingBetweenSlices is missing: overlapping or spaced slices
// have another.
TEST_F(MultiFrameTest, FramesOfThePlainClassAreSpacedByTheirThicknessWithoutASpacing) {
  DicomFile file = PlainPhantom();
  file.Text(kSliceThickness, "DS", "3");
  Write("ct", file.Bytes());
  ASSERT_OK_AND_ASSIGN(const CtVolume spaced, Read());
  EXPECT_NEAR(spaced.spacing_mm.z(), 1.25, 1e-9);
  for (const char* const thickness : {"1.25", "0.4"}) {
    SCOPED_TRACE(thickness);
    file = PlainPhantom();
    Write("ct", file.Erase(kSpacingBetweenSlices).Text(kSliceThickness, "DS", thickness).Bytes());
    ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
    EXPECT_THAT(volume.size, ElementsAre(12, 10, 9));
    EXPECT_NEAR(volume.spacing_mm.z(), std::stod(thickness), 1e-9);
    EXPECT_THAT(volume.provenance.notes,
                ::testing::Contains(HasSubstr("by SliceThickness where that is missing")));
    if (std::stod(thickness) == 1.25) {
      EXPECT_EQ(WorstPhantomError(volume), 0);
    }
  }
  for (const char* const thickness : {"", "0", "nan", "1e9"}) {
    file = PlainPhantom();
    Write("ct", file.Erase(kSpacingBetweenSlices).Text(kSliceThickness, "DS", thickness).Bytes());
    EXPECT_EQ(Read().status().code(), kInvalid) << thickness;
  }
}

TEST_F(MultiFrameTest, FramesOfThePlainClassNeedTheirSpacing) {
  for (const char* spacing : {"", "0", "nan", "1e9"}) {
    Write("ct", PlainPhantom().Text(kSpacingBetweenSlices, "DS", spacing).Bytes());
    EXPECT_EQ(Read().status().code(), kInvalid) << spacing;
  }
  Write("ct", PlainPhantom().Text(DicomFile::kNumberOfFrames, "IS", "2000000000").Bytes());
  EXPECT_THAT(Read(), StatusIs(kInvalid, HasSubstr("without frame positions")));
  Write("ct", PlainPhantom().Text(DicomFile::kNumberOfFrames, "IS", "20").Bytes());
  EXPECT_THAT(Read(), StatusIs(kInvalid, HasSubstr("cannot be read")));
}

TEST_F(MultiFrameTest, FramesWithoutAPlaceAreNamed) {
  const SeriesGeometry geometry;
  const DicomFile whole = EnhancedPhantom(geometry, {0, 1, 2, 3, 4, 5, 6, 7, 8}, true);
  DicomFile spoilt = whole;
  Write("ct", spoilt.Erase(DicomFile::kFrameGroups).Bytes());
  EXPECT_THAT(Read(), StatusIs(kInvalid, AllOf(HasSubstr("holds no CT slices"),
                                               HasSubstr("without frame positions"))));
  spoilt = whole;
  Write("ct", spoilt.Text(DicomFile::kNumberOfFrames, "IS", "10").Bytes());
  EXPECT_THAT(Read(), StatusIs(kInvalid, HasSubstr("without frame positions")));
  spoilt = whole;
  Write("ct", spoilt.Erase(DicomFile::kSharedGroups).Bytes());
  EXPECT_THAT(Read(), StatusIs(kInvalid, AllOf(HasSubstr("file 1 of the folder, frame 1"),
                                               HasSubstr("ImageOrientationPatient"))));
}

TEST_F(MultiFrameTest, CutOffFileIsRefusedWhereverItEnds) {
  const std::string whole = EnhancedPhantom({}, {0, 1, 2, 3, 4, 5, 6, 7, 8}, false).Bytes();
  for (size_t size = 0; size < whole.size(); size += 97) {
    Write("ct", whole.substr(0, size));
    EXPECT_EQ(Read().status().code(), kInvalid) << size;
  }
}

TEST_F(MultiFrameTest, DamagedGroupsNeverEndThisProcess) {
  const std::string whole = EnhancedPhantom({}, {0, 1, 2, 3, 4, 5, 6, 7, 8}, false).Bytes();
  constexpr size_t kBegin = 132;
  const size_t header_bytes = whole.size() - kBegin - size_t{2 * 12 * 10 * 9};
  std::mt19937 random(21);
  int refused = 0;
  for (int round = 0; round < 25; ++round) {
    std::string damaged = whole;
    for (int i = 0; i < 4; ++i) {
      damaged[kBegin + random() % header_bytes] = static_cast<char>(random() % 256);
    }
    Write("ct", damaged);
    refused += Read().ok() ? 0 : 1;
  }
  EXPECT_GT(refused, 5);
}

}  // namespace
}  // namespace tissueform
