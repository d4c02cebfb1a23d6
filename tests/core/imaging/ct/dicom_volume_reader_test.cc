// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <utility>

#include "tests/core/imaging/ct/ct_folder.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using tissueform::testing::CtFolder;
using tissueform::testing::DicomFile;
using tissueform::testing::IsOk;
using tissueform::testing::PhantomSeries;
using tissueform::testing::SeriesGeometry;
using tissueform::testing::StatusIs;
using tissueform::testing::WorstPhantomError;

using ::tissueform::testing::kInvalid;

// A value that a slice must not have, or not beside the others, and what is said of it.
struct BadValue {
  uint32_t tag;
  std::string vr;
  std::string value;
  std::string message;
};

class DicomVolumeTest : public CtFolder {
 protected:
  // Where only the fifth slice has the value.
  void ExpectFifthSliceIsRefused(const BadValue& bad) const {
    std::vector<DicomFile> series = PhantomSeries();
    series[4].Text(bad.tag, bad.vr, bad.value);
    WriteSeries(series);
    EXPECT_THAT(Read(),
                StatusIs(kInvalid, AllOf(HasSubstr("file 5 of the folder (instance number 5)"),
                                         HasSubstr(bad.message))));
  }
};

void Expect(const absl::StatusOr<CtVolume>& volume, const std::string& message) {
  EXPECT_THAT(volume, StatusIs(kInvalid, HasSubstr(message)));
}

// Turned by 30 degrees about the patient's long axis and stacked from head to feet.
SeriesGeometry Oblique() {
  SeriesGeometry geometry;
  geometry.row_direction = {std::sqrt(0.75), 0.5, 0};
  geometry.column_direction = {0.5, -std::sqrt(0.75), 0};
  geometry.step_mm = {0, 0, -2};
  return geometry;
}

// Slices leaning by the angle, stacked along the patient's long axis.
SeriesGeometry Tilted(double tilt_deg) {
  const double tilt = tilt_deg * M_PI / 180;
  SeriesGeometry geometry;
  geometry.column_direction = {0, std::cos(tilt), std::sin(tilt)};
  geometry.step_mm = {0, 0, 2.5};
  return geometry;
}

TEST_F(DicomVolumeTest, VoxelsLieWherePositionAndOrientationSay) {
  for (const SeriesGeometry& geometry : {SeriesGeometry(), Oblique(), Tilted(-18.5)}) {
    WriteSeries(PhantomSeries(geometry));
    ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
    EXPECT_THAT(volume.size, ElementsAre(12, 10, 9));
    EXPECT_NEAR(volume.spacing_mm[0], 0.5, 1e-12);
    EXPECT_NEAR(volume.spacing_mm[1], 0.75, 1e-12);
    EXPECT_NEAR(volume.spacing_mm[2], geometry.step_mm.norm(), 1e-9);
    EXPECT_LE(WorstPhantomError(volume), 1);  // positions are written with ten digits
  }
}

TEST_F(DicomVolumeTest, UprightSeriesIsExact) {
  WriteSeries(PhantomSeries());
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
  EXPECT_EQ(WorstPhantomError(volume), 0);
  EXPECT_TRUE(volume.direction.isIdentity(1e-12));
  EXPECT_TRUE(volume.origin_mm.isApprox(Eigen::Vector3d(-30, 20, 100), 1e-12));
  EXPECT_EQ(volume.provenance.format, "DICOM");
  EXPECT_EQ(volume.provenance.num_files, 9);
  EXPECT_EQ(volume.provenance.gantry_tilt_deg, 0);
  EXPECT_THAT(volume.provenance.notes, IsEmpty());
}

TEST_F(DicomVolumeTest, GantryTiltIsFoundWithItsSign) {
  for (const double tilt_deg : {-18.5, 12.0}) {
    WriteSeries(PhantomSeries(Tilted(tilt_deg)));
    ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
    EXPECT_NEAR(volume.provenance.gantry_tilt_deg, tilt_deg, 1e-6);
  }
}

TEST_F(DicomVolumeTest, SliceThicknessDoesNotMatter) {
  std::vector<DicomFile> series = PhantomSeries();
  for (DicomFile& file : series) file.Text(0x00180050, "DS", "5");
  WriteSeries(series);
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
  EXPECT_NEAR(volume.spacing_mm[2], 1.25, 1e-9);
}

TEST_F(DicomVolumeTest, RescaleIsApplied) {
  std::vector<DicomFile> series = PhantomSeries();
  for (DicomFile& file : series) {
    file.Text(DicomFile::kRescaleSlope, "DS", "1.5")
        .Text(DicomFile::kRescaleIntercept, "DS", "-1536");
  }
  WriteSeries(PhantomSeries());
  ASSERT_OK_AND_ASSIGN(const CtVolume plain, Read());
  WriteSeries(series);
  ASSERT_OK_AND_ASSIGN(const CtVolume larger, Read());
  for (size_t i = 0; i < plain.hu.size(); ++i) {
    EXPECT_NEAR(larger.hu[i], std::max(-1024.0, 1.5 * plain.hu[i]), 0.5);
  }
}

TEST_F(DicomVolumeTest, DigestDependsOnContentsNotOnNames) {
  WriteSeries(PhantomSeries());
  ASSERT_OK_AND_ASSIGN(const CtVolume before, Read());
  std::filesystem::rename(Path("slice003"), Path("zzz"));
  ASSERT_OK_AND_ASSIGN(const CtVolume renamed, Read());
  EXPECT_EQ(renamed.provenance.sha256, before.provenance.sha256);
  EXPECT_EQ(renamed.hu, before.hu);
  std::vector<DicomFile> series = PhantomSeries();
  series[2].Text(0x00081030, "LO", "other");
  WriteSeries(series);
  std::filesystem::remove(Path("zzz"));
  ASSERT_OK_AND_ASSIGN(const CtVolume changed, Read());
  EXPECT_NE(changed.provenance.sha256, before.provenance.sha256);
}

TEST_F(DicomVolumeTest, OneFileStandsForItsSeries) {
  WriteSeries(PhantomSeries());
  std::vector<DicomFile> other = PhantomSeries(Oblique());
  for (DicomFile& file : other) file.Text(DicomFile::kSeriesUid, "UI", "1.2.9");
  WriteSeries(other, "other");
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read({}, "other004"));
  EXPECT_NEAR(volume.spacing_mm[2], 2, 1e-9);
  EXPECT_THAT(volume.provenance.notes, ElementsAre(HasSubstr("ignored: series 2 (9 slices)")));
}

TEST_F(DicomVolumeTest, SeveralSeriesAreListedAndChosenByNumber) {
  WriteSeries(PhantomSeries());
  SeriesGeometry longer = Oblique();
  longer.slices = 11;
  std::vector<DicomFile> other = PhantomSeries(longer);
  for (DicomFile& file : other) {
    file.Text(DicomFile::kSeriesUid, "UI", "1.2.9").Text(DicomFile::kSeriesNumber, "IS", "7");
  }
  WriteSeries(other, "other");
  EXPECT_THAT(Read(),
              StatusIs(kInvalid, AllOf(HasSubstr("series 2 (9 slices), series 7 (11 slices)"),
                                       HasSubstr("\"series_number\""))));
  CtReadOptions options;
  options.series_number = 7;
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read(options));
  EXPECT_EQ(volume.size[2], 11);
  options.series_number = 3;
  EXPECT_THAT(Read(options), StatusIs(kInvalid, HasSubstr("has no series 3; it holds series 2")));
}

TEST_F(DicomVolumeTest, OtherSeriesAndOtherFilesAreLeftAsideWithANote) {
  WriteSeries(PhantomSeries());
  DicomFile scout = PhantomSeries().front();
  scout.Text(DicomFile::kSeriesUid, "UI", "1.2.8")
      .Text(DicomFile::kSeriesNumber, "IS", "1")
      .Text(DicomFile::kImageType, "CS", "ORIGINAL\\PRIMARY\\LOCALIZER");
  Write("scout", scout.Bytes());
  Write("readme.txt", "not a slice");
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
  EXPECT_EQ(volume.size[2], 9);
  EXPECT_THAT(volume.provenance.notes,
              ElementsAre(HasSubstr("series 1 (1 files; the first is a localizer"),
                          HasSubstr("1 files that are not DICOM")));
}

TEST_F(DicomVolumeTest, FolderWithoutCtSlicesIsRefusedWithItsContents) {
  Expect(Read(), "the folder is empty");
  std::filesystem::create_directory(Path("inner"));
  Expect(Read(), "no files in it or in the folders below it");
  Write("readme.txt", "not a slice");
  Expect(Read(), "none of the 1 files in the folder is a DICOM file");
  Expect(Read({}, "readme.txt"), "the file is not a DICOM file");
}

TEST_F(DicomVolumeTest, FolderWithADirectoryAndNoImageIsRefused) {
  DicomFile directory;
  Write("DICOMDIR", directory.Text(DicomFile::kSopClass, "UI", "1.2.840.10008.1.3.10").Bytes());
  Write("readme.txt", "not a slice");
  CtReadOptions fifth;
  fifth.series_number = 5;
  for (const CtReadOptions& options : {CtReadOptions(), fifth}) {
    Expect(Read(options), "holds no DICOM images, only a directory of them (DICOMDIR)");
  }
  WriteSeries(PhantomSeries());
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
  EXPECT_EQ(volume.size[2], 9);
  Expect(Read({}, "DICOMDIR"), "file 1 of the folder is not a CT slice but a directory (DICOMDIR)");
}

// What makes something else of a slice.
std::vector<BadValue> OtherKinds() {
  return {
      {DicomFile::kModality, "CS", "MR", "of modality MR"},
      {DicomFile::kSopClass, "UI", "1.2.840.10008.5.1.4.1.1.7", "a photograph or copy of a screen"},
      {DicomFile::kSopClass, "UI", "1.2.840.10008.5.1.4.1.1.77.1.4", "a photograph"},
      {DicomFile::kImageType, "CS", "ORIGINAL\\PRIMARY\\LOCALIZER", "a localizer"},
      {DicomFile::kPhotometric, "CS", "RGB", "a color image"},
      {DicomFile::kSamplesPerPixel, "US", std::string("\3\0", 2), "a color image"},
      {DicomFile::kSopClass, "UI", "1.2.840.10008.5.1.4.1.1.88.67", "not a conventional CT image"},
  };
}

TEST_F(DicomVolumeTest, FolderOfAnotherKindIsRefused) {
  std::vector<BadValue> kinds = OtherKinds();
  kinds.push_back({DicomFile::kNumberOfFrames, "IS", "4", "multi-frame"});
  for (const BadValue& kind : kinds) {
    std::vector<DicomFile> series = PhantomSeries();
    for (DicomFile& file : series) file.Text(kind.tag, kind.vr, kind.value);
    WriteSeries(series);
    EXPECT_THAT(Read(), StatusIs(kInvalid,
                                 AllOf(HasSubstr("holds no CT slices"), HasSubstr(kind.message))));
  }
  // They may be slices that are not read.
  ExpectFifthSliceIsRefused(kinds.back());
  ExpectFifthSliceIsRefused(
      {DicomFile::kRows, "US", std::string("\0\0", 2), "truncated or damaged"});
}

TEST_F(DicomVolumeTest, OtherObjectsOfTheSeriesAreLeftAsideWithANote) {
  for (const BadValue& kind : OtherKinds()) {
    std::vector<DicomFile> series = PhantomSeries();
    DicomFile other = series[4];
    series.push_back(other.Text(kind.tag, kind.vr, kind.value)
                         .Text(DicomFile::kInstanceNumber, "IS", "10")
                         .Text(DicomFile::kFrameOfReference, "UI", "1.2.9")
                         .Erase(DicomFile::kPosition)
                         .Erase(DicomFile::kRescaleIntercept)
                         .Erase(DicomFile::kRescaleSlope));
    WriteSeries(series);
    ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
    EXPECT_EQ(volume.size[2], 9);
    EXPECT_EQ(WorstPhantomError(volume), 0);
    EXPECT_THAT(volume.provenance.notes,
                ElementsAre(AllOf(HasSubstr("ignored in series 2, not CT slices: file 1 of"),
                                  HasSubstr(kind.message))));
    Expect(Read({}, "slice000"), "file 1 of the folder (instance number 10) is not a CT slice but");
  }
}

TEST_F(DicomVolumeTest, OtherObjectInThePlaceOfASliceIsNotedAsAGap) {
  std::vector<DicomFile> series = PhantomSeries();
  series[4].Text(DicomFile::kPhotometric, "CS", "RGB");
  WriteSeries(series);
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
  EXPECT_EQ(WorstPhantomError(volume), 0);
  EXPECT_THAT(volume.provenance.notes,
              ElementsAre(HasSubstr("file 5 of the folder (a color image)"),
                          HasSubstr("1 slice is missing between")));
}

TEST_F(DicomVolumeTest, MissingSliceIsNotedWithItsPlace) {
  std::vector<DicomFile> series = PhantomSeries();
  series.erase(series.begin() + 3);
  WriteSeries(series);
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
  EXPECT_EQ(WorstPhantomError(volume), 0);
  EXPECT_THAT(volume.provenance.notes,
              ElementsAre(AllOf(HasSubstr("1.25 to 2.50 mm apart, usually 1.25 mm"),
                                HasSubstr("1 slice is missing between"),
                                HasSubstr("20.00, 102.50) mm and"))));
}

TEST_F(DicomVolumeTest, SliceThatIsMissingBecauseItsFileIsDamagedIsRefused) {
  std::vector<DicomFile> series = PhantomSeries();
  series.erase(series.begin() + 3);
  WriteSeries(series);
  Write("zzz", std::string(100, '\0'));
  EXPECT_THAT(Read(), StatusIs(kInvalid, AllOf(HasSubstr("file 9 of the folder is a truncated "
                                                         "or damaged DICOM file"),
                                               HasSubstr("1 slice is missing"))));
  WriteSeries(PhantomSeries());  // nothing is missing beside it
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
  EXPECT_THAT(volume.provenance.notes, ElementsAre(HasSubstr("truncated or damaged")));
}

TEST_F(DicomVolumeTest, CopyOfASliceIsLeftAside) {
  std::vector<DicomFile> series = PhantomSeries();
  series.push_back(series[3]);
  WriteSeries(series);
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
  EXPECT_EQ(volume.size[2], 9);
  EXPECT_EQ(WorstPhantomError(volume), 0);
  EXPECT_THAT(volume.provenance.notes, ElementsAre(HasSubstr("1 files that are copies of others")));
}

TEST_F(DicomVolumeTest, OtherSliceAtTheSamePlaceIsRefused) {
  std::vector<DicomFile> series = PhantomSeries();
  series.push_back(series[3]);
  series.back().Pixels(std::vector<uint16_t>(120, 1000));
  WriteSeries(series);
  Expect(Read(), "have the same position");
}

// Where the phantom's slices are taken at other heights.
std::vector<DicomFile> SlicesAt(const std::vector<double>& heights, double tilt_deg = 0) {
  std::vector<DicomFile> series;
  for (const double height : heights) {
    SeriesGeometry geometry = Tilted(tilt_deg);
    geometry.slices = 1;
    geometry.origin_mm.z() = height;
    series.push_back(PhantomSeries(geometry).front());
    series.back().Text(DicomFile::kInstanceNumber, "IS", std::to_string(series.size()));
  }
  return series;
}

TEST_F(DicomVolumeTest, UnevenSlicesKeepTheirPlaces) {
  const std::vector<double> heights = {100, 101.25, 102.5, 104.1, 105, 105.5, 106, 111, 113, 119.5};
  for (const double tilt_deg : {0.0, -18.5}) {
    WriteSeries(SlicesAt(heights, tilt_deg));
    ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
    ASSERT_EQ(volume.slice_origins_mm.size(), heights.size());
    for (size_t k = 0; k < heights.size(); ++k) {
      EXPECT_NEAR(volume.slice_origins_mm[k].z(), heights[k], 1e-9);
    }
    EXPECT_LE(WorstPhantomError(volume), tilt_deg == 0 ? 0 : 1);
    EXPECT_NEAR(volume.provenance.gantry_tilt_deg, tilt_deg, 1e-6);
    EXPECT_THAT(volume.provenance.notes, ElementsAre(HasSubstr("the slices are unevenly spaced")));
  }
}

// Each gap is nearly the usual one, all together not.
TEST_F(DicomVolumeTest, DriftingSlicesKeepTheirPlaces) {
  std::vector<double> heights;
  heights.reserve(9);
  for (int i = 0; i < 9; ++i) heights.push_back(100 + 1.25 * i + (i > 4 ? 0.09 * (i - 4) : 0));
  WriteSeries(SlicesAt(heights));
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
  EXPECT_EQ(volume.slice_origins_mm.size(), 9U);
  EXPECT_LE(WorstPhantomError(volume), 1);
}

TEST_F(DicomVolumeTest, SlicesFartherApartThanAPlanMayRestOnAreHandedOn) {
  WriteSeries(SlicesAt({100, 102, 104, 106, 112.5, 115, 117.5, 123, 129, 131, 133}));
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
  const std::vector<SliceGap>& gaps = volume.provenance.wide_gaps;
  ASSERT_EQ(gaps.size(), 2U);
  EXPECT_NEAR(gaps[0].from_mm, 106, 1e-9);
  EXPECT_NEAR(gaps[0].to_mm, 112.5, 1e-9);
  EXPECT_NEAR(gaps[0].largest_mm, 6.5, 1e-9);
  EXPECT_NEAR(gaps[1].from_mm, 117.5, 1e-9);
  EXPECT_NEAR(gaps[1].to_mm, 129, 1e-9);
  EXPECT_NEAR(gaps[1].largest_mm, 6, 1e-9);
  EXPECT_TRUE(gaps[0].normal.isApprox(Eigen::Vector3d::UnitZ(), 1e-9));
}

TEST_F(DicomVolumeTest, HoleThatNoProtocolLeavesIsRefused) {
  WriteSeries(SlicesAt({100, 102, 104, 106, 108, 110, 112, 114, 160, 162}));
  Expect(Read(), "there is no slice for 46 mm between");
}

TEST_F(DicomVolumeTest, RoundedPositionsAreAccepted) {
  SeriesGeometry geometry;
  geometry.step_mm = {0, 0, 0.625};
  std::vector<DicomFile> series = PhantomSeries(geometry);
  for (size_t i = 0; i < series.size(); ++i) {
    const double height = std::round(10 * (100 + 0.625 * static_cast<double>(i))) / 10;
    series[i].Text(DicomFile::kPosition, "DS", "-30\\20\\" + std::to_string(height));
  }
  WriteSeries(series);
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
  EXPECT_NEAR(volume.spacing_mm[2], 0.625, 0.01);
}

TEST_F(DicomVolumeTest, SlicesThatAreNotOneVolumeAreRefused) {
  const std::vector<BadValue> values = {
      {DicomFile::kOrientation, "DS", "0\\1\\0\\1\\0\\0", "in orientation"},
      {DicomFile::kPixelSpacing, "DS", "0.75\\0.55", "in pixel spacing"},
      {DicomFile::kRows, "US", std::string("\x0c\0", 2), "in size (12 x 12 instead of 12 x 10)"},
  };
  for (const BadValue& bad : values) ExpectFifthSliceIsRefused(bad);
}

TEST_F(DicomVolumeTest, EachSliceHasItsOwnRescale) {
  std::vector<DicomFile> series = PhantomSeries();
  WriteSeries(series);
  ASSERT_OK_AND_ASSIGN(const CtVolume plain, Read());
  const auto store_slice = [&](size_t k, int slope_inverse, int intercept) {
    std::vector<uint16_t> pixels;
    for (size_t i = 0; i < 120; ++i) {
      pixels.push_back(static_cast<uint16_t>(slope_inverse * (plain.hu[120 * k + i] - intercept)));
    }
    series[k]
        .Pixels(pixels)
        .Text(DicomFile::kRescaleIntercept, "DS", std::to_string(intercept))
        .Text(DicomFile::kRescaleSlope, "DS", std::to_string(1.0 / slope_inverse));
  };
  store_slice(2, 1, -1020);
  store_slice(5, 2, -2045);
  WriteSeries(series);
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
  EXPECT_EQ(volume.hu, plain.hu);
  EXPECT_THAT(volume.provenance.notes,
              ElementsAre(AllOf(HasSubstr("RescaleIntercept -1024 and RescaleSlope 1, in 7 of 9"),
                                HasSubstr("RescaleIntercept -2045 to -1020"))));
}

TEST_F(DicomVolumeTest, MissingTagsAreNamed) {
  const std::vector<std::pair<uint32_t, std::string>> tags = {
      {DicomFile::kPosition, "ImagePositionPatient"},
      {DicomFile::kOrientation, "ImageOrientationPatient"},
      {DicomFile::kPixelSpacing, "PixelSpacing"},
      {DicomFile::kRescaleIntercept, "RescaleIntercept"},
  };
  for (const auto& [tag, message] : tags) {
    std::vector<DicomFile> series = PhantomSeries();
    series[4].Erase(tag);
    WriteSeries(series);
    EXPECT_THAT(Read(),
                StatusIs(kInvalid, AllOf(HasSubstr("instance number 5"), HasSubstr(message))));
  }
  std::vector<DicomFile> series = PhantomSeries();
  series[4].Text(DicomFile::kPosition, "DS", "1\\nan\\3");
  WriteSeries(series);
  Expect(Read(), "ImagePositionPatient");
}

CtReadOptions OfHu() {
  CtReadOptions options;
  options.values = CtValues::kHu;
  return options;
}

TEST_F(DicomVolumeTest, OffsetTakesThePlaceOfMissingRescaleTagsOnly) {
  CtReadOptions options;
  options.hu_offset = -1024;
  std::vector<DicomFile> series = PhantomSeries();
  WriteSeries(series);
  Expect(Read(options), "remove \"hu_offset\" from the recipe");
  for (DicomFile& file : series)
    file.Erase(DicomFile::kRescaleIntercept).Erase(DicomFile::kRescaleSlope);
  WriteSeries(series);
  Expect(Read(OfHu()), "state \"hu_offset\" in the recipe");
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read(options));
  EXPECT_EQ(WorstPhantomError(volume), 0);
}

TEST_F(DicomVolumeTest, NoOffsetIsAdvisedWhereOtherSlicesStateARescale) {
  std::vector<DicomFile> series = PhantomSeries();
  series[4].Erase(DicomFile::kRescaleIntercept).Erase(DicomFile::kRescaleSlope);
  WriteSeries(series);
  CtReadOptions with_offset;
  with_offset.hu_offset = -1024;
  for (const CtReadOptions& options : {CtReadOptions(), with_offset}) {
    Expect(Read(options),
           "calibration to HU (RescaleSlope, RescaleIntercept); export the series again");
  }
}

// Old scanners: values HU + 1024, and a rescale that says they were HU already. What one message
// asks for no other takes back.
TEST_F(DicomVolumeTest, OffsetCorrectsARescaleThatDoesNotGiveHu) {
  std::vector<DicomFile> series = PhantomSeries({.columns = 24, .slices = 12});
  for (DicomFile& file : series) file.Text(DicomFile::kRescaleIntercept, "DS", "0");
  WriteSeries(series);
  Expect(Read(OfHu()), "state \"hu_offset\"");
  CtReadOptions options;
  options.hu_offset = -1024;
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read(options));
  EXPECT_EQ(WorstPhantomError(volume), 0);
  EXPECT_THAT(volume.provenance.notes, ElementsAre(HasSubstr("RescaleIntercept 0")));
  options.hu_offset = 24;
  Expect(Read(options), "hu_offset 24; correct it in the recipe");
}

// The other way round: an intercept for values that were HU already.
TEST_F(DicomVolumeTest, OffsetUndoesARescaleThatWasAppliedTwice) {
  std::vector<DicomFile> series = PhantomSeries();
  for (DicomFile& file : series) file.Text(DicomFile::kRescaleIntercept, "DS", "-4000");
  WriteSeries(series);
  Expect(Read(), "only air");
  Expect(Read(), "state \"hu_offset\"");
  CtReadOptions options;
  options.hu_offset = 2976;
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read(options));
  EXPECT_EQ(WorstPhantomError(volume), 0);
}

TEST_F(DicomVolumeTest, AbsurdGeometryIsRefused) {
  SeriesGeometry wide;
  wide.pixel_spacing_mm = {0.75, 20};
  WriteSeries(PhantomSeries(wide));
  Expect(Read(), "20 x 0.75 mm");
  SeriesGeometry high;
  high.step_mm = {0, 0, 30};
  high.origin_mm[2] = 0;
  WriteSeries(PhantomSeries(high));
  Expect(Read(), "the slices are 30.000 mm apart");
  WriteSeries(PhantomSeries(Tilted(50)));
  Expect(Read(), "50.0 degrees off their normal");
  SeriesGeometry slanted;
  slanted.column_direction = {0.5, 0.5, 0};
  WriteSeries(PhantomSeries(slanted));
  Expect(Read(), "not two directions square to each other");
}

TEST_F(DicomVolumeTest, TooFewSlicesAreRefused) {
  SeriesGeometry thin;
  thin.slices = 7;
  WriteSeries(PhantomSeries(thin));
  Expect(Read(), "the series has 7 slices; a volume needs at least 8");
}

TEST_F(DicomVolumeTest, CutOffFileIsRefusedWhereverItEnds) {
  const std::string whole = PhantomSeries()[4].Bytes();
  for (const size_t missing : {size_t{1}, size_t{2}, size_t{100}, size_t{239}}) {
    WriteSeries(PhantomSeries());
    Write("slice004", whole.substr(0, whole.size() - missing));
    EXPECT_THAT(Read(), StatusIs(kInvalid, HasSubstr("file 5 of the folder (instance number 5)")))
        << missing;
  }
  for (size_t size = 0; size + 250 < whole.size(); size += 37) {
    WriteSeries(PhantomSeries());
    Write("slice004", whole.substr(0, size));
    EXPECT_THAT(Read().status().code(), kInvalid) << size;
  }
}

TEST_F(DicomVolumeTest, PaddingOutsideTheScannersCircleIsAir) {
  std::vector<DicomFile> series = PhantomSeries();
  std::vector<uint16_t> pixels(120, 2000);
  pixels[7] = 0;
  for (DicomFile& file : series) file.Text(DicomFile::kRescaleIntercept, "DS", "-3024");
  for (DicomFile& file : series) file.Pixels(pixels);
  pixels.assign(120, 3050);
  series[0].Pixels(pixels);
  WriteSeries(series);
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
  EXPECT_EQ(volume.At(7, 0, 1), -1024);
  EXPECT_EQ(volume.At(8, 0, 1), -1024);
  EXPECT_EQ(volume.At(8, 0, 0), 26);
}

TEST_F(DicomVolumeTest, LimitsHold) {
  WriteSeries(PhantomSeries());
  const auto read_with = [this](const CtReadLimits& limits) {
    CtReadOptions options;
    options.limits = limits;
    return Read(options);
  };
  constexpr auto kExhausted = absl::StatusCode::kResourceExhausted;
  EXPECT_THAT(read_with({.max_files = 8}), StatusIs(kExhausted, HasSubstr("more than 8 files")));
  EXPECT_THAT(read_with({.max_files = 9}), IsOk());
  EXPECT_THAT(read_with({.max_voxels = 1079}), StatusIs(kExhausted, HasSubstr("1080 voxels")));
  EXPECT_THAT(read_with({.max_voxels = 1080}), IsOk());
  EXPECT_THAT(read_with({.max_file_bytes = 5000}), StatusIs(kExhausted, HasSubstr("bytes")));
}

}  // namespace
}  // namespace tissueform
