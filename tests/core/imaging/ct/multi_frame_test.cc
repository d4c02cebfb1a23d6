// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// Enhanced CT: a whole scan in one file.

#include <random>

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
