// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// What is one CT although its files do not say so, and what is several.

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "tests/core/imaging/ct/ct_folder.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using tissueform::testing::CtFolder;
using tissueform::testing::DicomFile;
using tissueform::testing::PhantomSeries;
using tissueform::testing::ReadBundledHead;
using tissueform::testing::SeriesGeometry;
using tissueform::testing::SeriesOf;
using tissueform::testing::SharedDataPath;
using tissueform::testing::StatusIs;
using tissueform::testing::WorstPhantomError;

using ::tissueform::testing::kInvalid;

using Series = std::vector<DicomFile>;

// As some programs anonymise: a series, study and frame of reference of its own for every file.
void TearApart(Series* series) {
  for (size_t i = 0; i < series->size(); ++i) {
    (*series)[i]
        .Text(DicomFile::kSeriesUid, "UI", absl::StrCat("1.2.3.", 1000 + i))
        .Text(DicomFile::kStudyUid, "UI", absl::StrCat("1.2.4.", 1000 + i))
        .Text(DicomFile::kFrameOfReference, "UI", absl::StrCat("1.2.5.", 1000 + i))
        .Text(DicomFile::kInstanceNumber, "IS", "0");
  }
}

void SetEverywhere(uint32_t tag, const std::string& vr, const std::string& value, Series* series) {
  for (DicomFile& file : *series) file.Text(tag, vr, value);
}

// Taken one after the other, half a second each, from 10:00 and so many seconds.
void SetTimes(uint32_t tag, int from_s, Series* series) {
  for (size_t i = 0; i < series->size(); ++i) {
    const double seconds = from_s + 0.5 * static_cast<double>(i);
    (*series)[i].Text(
        tag, "TM",
        absl::StrFormat("10%02d%06.3f", static_cast<int>(seconds) / 60, std::fmod(seconds, 60)));
  }
}

// Some slices of the phantom, taken again at other places: another patient's posture.
Series Again(const std::vector<int>& slices, double shift_mm) {
  Series again;
  for (const int slice : slices) {
    SeriesGeometry geometry;
    geometry.slices = 1;
    geometry.origin_mm.z() += 1.25 * slice;
    again.push_back(PhantomSeries(geometry).front());
    again.back().Pixels(std::vector<uint16_t>(120, 900));
    again.back().Text(DicomFile::kPosition, "DS",
                      absl::StrFormat("-30\\20\\%.4f", 100 + 1.25 * slice + shift_mm));
  }
  return again;
}

Series Joined(Series a, const Series& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

Series LongPhantom() { return PhantomSeries({.slices = 24}); }

class DicomSeriesTest : public CtFolder {
 protected:
  absl::StatusOr<CtVolume> ReadJoining(JoinSeries join) const {
    CtReadOptions options;
    options.join_series = join;
    return Read(options);
  }
  void ExpectPhantom(int slices, const std::string& note) const {
    ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
    EXPECT_EQ(volume.size[2], slices);
    EXPECT_EQ(WorstPhantomError(volume), 0);
    EXPECT_THAT(volume.provenance.notes, ::testing::Contains(HasSubstr(note)));
  }
};

TEST_F(DicomSeriesTest, BundledHeadTornApartIsReadAsOne) {
  ASSERT_OK_AND_ASSIGN(const CtVolume head, ReadBundledHead());
  Series series = SeriesOf(head);
  WriteSeries(series);
  ASSERT_OK_AND_ASSIGN(const CtVolume whole, Read());
  EXPECT_EQ(whole.hu.size(), head.hu.size());
  TearApart(&series);
  WriteSeries(series);
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
  EXPECT_EQ(volume.hu, whole.hu);
  EXPECT_TRUE(volume.slice_origins_mm.empty());
  EXPECT_THAT(volume.provenance.notes,
              ElementsAre(HasSubstr("93 slices of 93 series are read as")));
}

TEST_F(DicomSeriesTest, RescanAmongTheSlicesOfTheBundledHeadIsLeftOut) {
  ASSERT_OK_AND_ASSIGN(const CtVolume head, ReadBundledHead());
  Series first = SeriesOf(head);
  SetTimes(DicomFile::kAcquisitionTime, 0, &first);
  WriteSeries(first);
  ASSERT_OK_AND_ASSIGN(const CtVolume whole, Read());
  CtVolume moved = head;
  moved.origin_mm.z() += 0.6;
  const Series all = SeriesOf(moved);
  Series later = {all[20], all[21], all[50], all[52]};
  SetTimes(DicomFile::kAcquisitionTime, 900, &later);
  Series together = Joined(first, later);
  TearApart(&together);
  WriteSeries(together);
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
  EXPECT_EQ(volume.hu, whole.hu);
  EXPECT_THAT(volume.provenance.notes,
              ElementsAre(HasSubstr("93 slices of 97 series"),
                          AllOf(HasSubstr("left out: 4 slices of another scan"),
                                HasSubstr("acquisition time"), HasSubstr("files 1, 2, 3, 4 of"))));
}

TEST_F(DicomSeriesTest, TwoThicknessesOfTheBundledHeadAreRead) {
  ASSERT_OK_AND_ASSIGN(const CtVolume head, ReadBundledHead());
  const Series all = SeriesOf(head);
  Series series;
  for (size_t k = 0; k < all.size(); k += k < 45 ? 4 : 2) series.push_back(all[k]);  // from the top
  WriteSeries(series);
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
  ASSERT_EQ(volume.slice_origins_mm.size(), series.size());
  for (int j = 0; j < head.size[1]; ++j) {
    for (int i = 0; i < head.size[0]; ++i) {
      ASSERT_EQ(volume.At(i, j, 0), head.At(i, j, 0));
      ASSERT_EQ(volume.At(i, j, 1), head.At(i, j, 4));
    }
  }
  ASSERT_EQ(volume.provenance.wide_gaps.size(), 1U);
  EXPECT_NEAR(volume.provenance.wide_gaps[0].largest_mm, 6, 1e-6);
  // In LPS, although the head's slices are counted from the top.
  EXPECT_TRUE(volume.provenance.wide_gaps[0].normal.isApprox(Eigen::Vector3d::UnitZ(), 1e-9));
  EXPECT_NEAR(volume.provenance.wide_gaps[0].to_mm, 0, 1e-6);
  EXPECT_NEAR(volume.provenance.wide_gaps[0].from_mm, -1.5 * 48, 1e-6);
}

TEST_F(DicomSeriesTest, RawBundledHeadIsReadOnceTheSuggestedOffsetIsAdded) {
  ASSERT_OK_AND_ASSIGN(const CtVolume head, ReadBundledHead());
  Series series = SeriesOf(head);
  WriteSeries(series);
  ASSERT_OK_AND_ASSIGN(const CtVolume whole, Read());
  SetEverywhere(DicomFile::kRescaleIntercept, "DS", "0", &series);
  WriteSeries(series);
  EXPECT_THAT(Read(), StatusIs(kInvalid, HasSubstr("add \"hu_offset\": -1024 to the recipe")));
  CtReadOptions options;
  options.hu_offset = -1024;
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read(options));
  EXPECT_EQ(volume.hu, whole.hu);
}

TEST_F(DicomSeriesTest, FindsThePropertyThatDistinguishesTwoScans) {
  const std::vector<std::pair<uint32_t, std::string>> times = {
      {DicomFile::kAcquisitionTime, "acquisition time"}, {DicomFile::kContentTime, "content time"}};
  for (const double shift_mm : {0.5, 0.0}) {
    for (const auto& [tag, name] : times) {
      Series first = LongPhantom();
      Series later = Again({3, 4, 11, 14}, shift_mm);
      SetTimes(tag, 0, &first);
      SetTimes(tag, 400, &later);
      Series all = Joined(first, later);
      TearApart(&all);
      WriteSeries(all);
      ExpectPhantom(24, absl::StrCat("told apart by ", name));
    }
    const std::vector<std::pair<uint32_t, std::string>> values = {
        {DicomFile::kSeriesTime, "series time"},
        {DicomFile::kAcquisitionNumber, "acquisition number"}};
    for (const auto& [tag, name] : values) {
      Series first = LongPhantom();
      Series later = Again({3, 4, 11, 14}, shift_mm);
      SetEverywhere(tag, tag == DicomFile::kSeriesTime ? "TM" : "IS", "100000", &first);
      SetEverywhere(tag, tag == DicomFile::kSeriesTime ? "TM" : "IS", "110000", &later);
      WriteSeries(Joined(first, later));
      ExpectPhantom(24, absl::StrCat("told apart by ", name));
    }
  }
}

TEST_F(DicomSeriesTest, PlaceAloneDistinguishesSlicesOffTheStep) {
  Series all = Joined(LongPhantom(), Again({3, 4, 11, 14}, 0.5));
  TearApart(&all);
  WriteSeries(all);
  ExpectPhantom(24, "told apart by place");
}

TEST_F(DicomSeriesTest, ScansThatFollowEachOtherStayTogetherWhateverTheirTimes) {
  Series series = LongPhantom();
  for (size_t i = 0; i < series.size(); ++i) {
    series[i]
        .Text(DicomFile::kAcquisitionTime, "TM", i < 10 ? "100000" : "101500")
        .Text(DicomFile::kAcquisitionNumber, "IS", absl::StrCat(i / 2));
  }
  WriteSeries(series);
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
  EXPECT_EQ(WorstPhantomError(volume), 0);
  EXPECT_EQ(volume.size[2], 24);
  EXPECT_THAT(volume.provenance.notes, IsEmpty());
}

TEST_F(DicomSeriesTest, SlicesTakenAgainIntoAHoleStay) {
  Series series = LongPhantom();
  SetEverywhere(DicomFile::kAcquisitionTime, "TM", "100000", &series);
  for (const size_t i : {7, 8, 13}) series[i].Text(DicomFile::kAcquisitionTime, "TM", "102000");
  WriteSeries(series);
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
  EXPECT_EQ(volume.size[2], 24);
  EXPECT_EQ(WorstPhantomError(volume), 0);
}

TEST_F(DicomSeriesTest, InterleavedPhasesAMinuteApartAreTwo) {
  Series series = LongPhantom();
  for (size_t i = 0; i < series.size(); ++i) {
    series[i].Text(DicomFile::kAcquisitionTime, "TM", i % 2 == 0 ? "100000" : "100130");
  }
  WriteSeries(series);
  EXPECT_THAT(Read(), StatusIs(kInvalid, AllOf(HasSubstr("2 CT series"),
                                               HasSubstr("naming one of its files"))));
  ASSERT_OK_AND_ASSIGN(const CtVolume one, Read({}, "slice003"));  // the remedy
  EXPECT_EQ(one.size[2], 12);
  EXPECT_EQ(WorstPhantomError(one), 0);
  ASSERT_OK_AND_ASSIGN(const CtVolume both, ReadJoining(JoinSeries::kAlways));
  EXPECT_EQ(both.size[2], 24);
}

TEST_F(DicomSeriesTest, TwoReconstructionsOfOneScanAreTwoAlsoTornApart) {
  Series soft = LongPhantom();
  Series bone = LongPhantom();
  SetEverywhere(DicomFile::kKernel, "SH", "H30s", &soft);
  SetEverywhere(DicomFile::kKernel, "SH", "H70h", &bone);
  SetEverywhere(DicomFile::kSeriesNumber, "IS", "5", &bone);
  Series all = Joined(soft, bone);
  for (const bool torn : {false, true}) {
    if (torn) TearApart(&all);
    WriteSeries(all);
    EXPECT_THAT(Read(),
                StatusIs(kInvalid, HasSubstr("series 2 (24 slices), series 5 (24 slices)")));
    CtReadOptions options;
    options.series_number = 5;
    ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read(options));
    EXPECT_EQ(volume.size[2], 24);
  }
}

TEST_F(DicomSeriesTest, PatientsAreNeverJoined) {
  Series all = LongPhantom();
  TearApart(&all);
  for (size_t i = 0; i < all.size(); ++i) {
    all[i].Text(DicomFile::kPatientId, "LO", i % 2 == 0 ? "Doe1" : "Doe2");
  }
  WriteSeries(all);
  for (const JoinSeries join : {JoinSeries::kAuto, JoinSeries::kAlways}) {
    EXPECT_THAT(ReadJoining(join), StatusIs(kInvalid, HasSubstr("2 CT series of 2 patients")));
  }
}

TEST_F(DicomSeriesTest, OtherSizesAndOrientationsAreNeverJoined) {
  const std::vector<std::pair<uint32_t, std::string>> values = {
      {DicomFile::kOrientation, "0\\1\\0\\0\\0\\-1"}, {DicomFile::kPixelSpacing, "0.5\\0.5"}};
  for (const auto& [tag, value] : values) {
    Series all = LongPhantom();
    for (const size_t i : {0, 1}) all[i].Text(tag, "DS", value);
    TearApart(&all);
    WriteSeries(all);
    for (const JoinSeries join : {JoinSeries::kAuto, JoinSeries::kAlways}) {
      ASSERT_OK_AND_ASSIGN(const CtVolume volume, ReadJoining(join));
      EXPECT_EQ(volume.size[2], 22);
      EXPECT_EQ(WorstPhantomError(volume), 0);
      EXPECT_THAT(volume.provenance.notes, ::testing::Contains(HasSubstr("ignored: series 2")));
    }
  }
}

TEST_F(DicomSeriesTest, DifferentFramesOfReferenceKeepSeriesApart) {
  Series first = LongPhantom();
  Series second = LongPhantom();
  for (size_t i = 0; i < second.size(); ++i) {
    second[i].Text(DicomFile::kPosition, "DS",
                   absl::StrFormat("-30\\20\\%.3f", 130 + 1.25 * static_cast<double>(i)));
  }
  SetEverywhere(DicomFile::kSeriesUid, "UI", "1.2.8", &second);
  SetEverywhere(DicomFile::kSeriesNumber, "IS", "8", &second);
  SetEverywhere(DicomFile::kFrameOfReference, "UI", "1.7.1", &first);
  SetEverywhere(DicomFile::kFrameOfReference, "UI", "1.7.2", &second);
  WriteSeries(Joined(first, second));
  EXPECT_THAT(Read(), StatusIs(kInvalid, HasSubstr("\"join_series\": \"always\"")));
  ASSERT_OK_AND_ASSIGN(const CtVolume forced, ReadJoining(JoinSeries::kAlways));
  EXPECT_EQ(forced.size[2], 48);
  SetEverywhere(DicomFile::kFrameOfReference, "UI", "1.7.1", &second);
  WriteSeries(Joined(first, second));
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, Read());
  EXPECT_EQ(volume.size[2], 48);
  EXPECT_THAT(volume.provenance.notes, ElementsAre(HasSubstr("48 slices of 2 series")));
  EXPECT_THAT(ReadJoining(JoinSeries::kNever), StatusIs(kInvalid, HasSubstr("2 CT series")));
}

TEST_F(DicomSeriesTest, ManySeriesAreSummedUpInOneLine) {
  Series all = LongPhantom();
  TearApart(&all);
  WriteSeries(all);
  EXPECT_THAT(ReadJoining(JoinSeries::kNever),
              StatusIs(kInvalid, AllOf(HasSubstr("24 series of one image each"),
                                       HasSubstr("leave \"join_series\": \"never\" out"),
                                       Not(HasSubstr("series 2 (1 slices), series 2")))));
  Series several;
  for (int i = 0; i < 5; ++i) {
    Series one = PhantomSeries({.slices = 9 + i});
    SetEverywhere(DicomFile::kSeriesUid, "UI", absl::StrCat("1.2.", i + 1), &one);
    SetEverywhere(DicomFile::kSeriesNumber, "IS", absl::StrCat(i + 1), &one);
    several = Joined(several, one);
  }
  WriteSeries(several);
  EXPECT_THAT(Read(), StatusIs(kInvalid,
                               AllOf(HasSubstr("5 series with 55 images in all, the largest series "
                                               "5 (13 slices), series 4 (12 slices), series 3 (11"),
                                     Not(HasSubstr("series 1 (")), HasSubstr("series_number"))));
}

TEST_F(DicomSeriesTest, IgnoresSeriesTooShortForAVolume) {
  Series bolus;  // the same place again and again, while contrast comes
  for (int i = 0; i < 5; ++i) bolus.push_back(PhantomSeries({.slices = 1}).front());
  SetEverywhere(DicomFile::kSeriesUid, "UI", "1.2.8", &bolus);
  SetEverywhere(DicomFile::kSeriesNumber, "IS", "8", &bolus);
  for (size_t i = 0; i < bolus.size(); ++i) {
    bolus[i].Text(DicomFile::kInstanceNumber, "IS", absl::StrCat(i));
  }
  WriteSeries(Joined(LongPhantom(), bolus));
  ExpectPhantom(24, "ignored: series 8 (5 slices)");
}

// 28 slices of a GE scanner (SOURCE.md of the data): 13 of 4.22 mm, then 13 of 7.38 mm, leaning.
TEST_F(DicomSeriesTest, TwoThicknessesOfARealScannerAreRead) {
  const std::string archive =
      SharedDataPath("ct_dicom_ge_two_thicknesses/ge_two_thicknesses.tar.xz");
  if (archive.empty()) GTEST_SKIP() << "without the large data sets";
  const std::string unpack = "tar -xJf '" + archive + "' -C '" + Path() + "' 2>/dev/null";
  if (std::system(unpack.c_str()) != 0) GTEST_SKIP() << "without tar and xz";
  ASSERT_OK_AND_ASSIGN(const CtVolume head, Read());
  EXPECT_THAT(head.size, ElementsAre(512, 512, 28));
  EXPECT_NEAR(head.slice_origins_mm[13].z(), 60.6960586, 1e-6);
  EXPECT_NEAR(head.slice_origins_mm[14].z(), 61.8360586, 1e-6);
  EXPECT_NEAR(head.provenance.gantry_tilt_deg, -18.5, 0.01);
  ASSERT_EQ(head.provenance.wide_gaps.size(), 1U);
  EXPECT_NEAR(head.provenance.wide_gaps[0].largest_mm, 7.38 * 0.9483237, 1e-3);
}

}  // namespace
}  // namespace tissueform
