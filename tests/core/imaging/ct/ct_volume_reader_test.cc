// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/ct_volume_reader.h"

#include <cstdlib>
#include <random>
#include <thread>
#include <vector>

#include "core/imaging/ct/isotropic_resample.h"
#include "tests/core/imaging/ct/ct_folder.h"
#include "tests/testing/busy_threads.h"
#include "tests/testing/meshes.h"

namespace tissueform {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using tissueform::testing::CtFolder;
using tissueform::testing::PhantomSeries;
using tissueform::testing::SharedDataPath;
using tissueform::testing::StatusIs;
using tissueform::testing::TestDataPath;

using CtVolumeReaderTest = CtFolder;

TEST_F(CtVolumeReaderTest, SeveralMayBeReadAtOnceWhileOtherThreadsAllocate) {
  WriteSeries(PhantomSeries());
  ASSERT_OK_AND_ASSIGN(const CtVolume alone, Read());
  const testing::BusyThreads busy(3);
  constexpr int kReaders = 4;
  std::vector<std::thread> readers;
  readers.reserve(kReaders);
  for (int t = 0; t < kReaders; ++t) {
    readers.emplace_back([&] {
      for (int i = 0; i < 3; ++i) {
        const absl::StatusOr<CtVolume> volume = ReadCtVolume(Path());
        ASSERT_THAT(volume, testing::IsOk());
        EXPECT_EQ(volume->hu, alone.hu);
      }
    });
  }
  for (std::thread& reader : readers) reader.join();
}

TEST_F(CtVolumeReaderTest, DamagedBytesNeverEndThisProcess) {
  WriteSeries(PhantomSeries());
  const std::string whole = PhantomSeries()[4].Bytes();
  constexpr size_t kBegin = 132;  // of the header, where lengths and tags are
  const size_t header_bytes = whole.size() - kBegin - size_t{2 * 12 * 10};
  CtReadOptions options;
  options.limits.max_memory_bytes = 64 << 20;
  std::mt19937 random(11);
  int refused = 0;
  for (int round = 0; round < 25; ++round) {
    std::string damaged = whole;
    for (int i = 0; i < 4; ++i) {
      damaged[kBegin + random() % header_bytes] = static_cast<char>(random() % 256);
    }
    Write("slice004", damaged);
    refused += Read(options).ok() ? 0 : 1;
  }
  EXPECT_GT(refused, 5);
}

TEST_F(CtVolumeReaderTest, DamagedHeadersOfVolumesNeverEndThisProcess) {
  const std::string header =
      "NRRD0004\ntype: int16\ndimension: 3\nsizes: 12 10 9\nendian: little\n"
      "encoding: raw\nspace: LPS\nspace directions: (1,0,0) (0,1,0) (0,0,1)\n\n";
  std::mt19937 random(12);
  int refused = 0;
  for (int round = 0; round < 60; ++round) {
    std::string damaged = header + std::string(2160, '\0');
    for (int i = 0; i < 3; ++i) damaged[9 + random() % 120] = static_cast<char>(random() % 128);
    Write("v.nrrd", damaged);
    refused += Read({}, "v.nrrd").ok() ? 0 : 1;
  }
  EXPECT_EQ(refused, 60);  // all voxels are 0: no air
}

TEST_F(CtVolumeReaderTest, FilesLargerThanTheLimitAreNotRead) {
  CtReadOptions options;
  options.axes = "RPI";
  options.hu_offset = -1024;
  options.limits.max_file_bytes = 1000;
  EXPECT_THAT(ReadCtVolume(TestDataPath("ct/headsq/headsq_quarter.nhdr"), options),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("limit")));
}

// 54 slices of a plastic skull, gantry tilted by -18.5 degrees (SOURCE.md of the data).
TEST_F(CtVolumeReaderTest, TiltedSeriesOfARealScannerIsPutUpright) {
  const std::string archive =
      SharedDataPath("ct_dicom_philips_tilt/philips_plastic_skull_tilt.tar.xz");
  if (archive.empty()) GTEST_SKIP() << "without the large data sets";
  const std::string unpack = "tar -xJf '" + archive + "' -C '" + Path() + "' 2>/dev/null";
  if (std::system(unpack.c_str()) != 0) GTEST_SKIP() << "without tar and xz";
  ASSERT_OK_AND_ASSIGN(const CtVolume skull, Read({}, "S2010"));
  EXPECT_THAT(skull.size, ElementsAre(512, 512, 54));
  EXPECT_NEAR(skull.spacing_mm[0], 0.482421875, 1e-9);
  EXPECT_NEAR(skull.spacing_mm[2], 2.5, 1e-3);
  EXPECT_NEAR(skull.provenance.gantry_tilt_deg, -18.5, 0.01);
  // Sheared: as high as 53 steps upward and the lean of 511 rows.
  ASSERT_OK_AND_ASSIGN(const HuGrid grid, ResampleIsotropic(skull, 4));
  EXPECT_NEAR(grid.geometry.size[2] * 4.0, 54 * 2.5 + 512 * 0.482421875 * 0.3173, 4);
  EXPECT_NEAR(grid.geometry.size[1] * 4.0, 512 * 0.482421875 * 0.9483, 4);
}

}  // namespace
}  // namespace tissueform
