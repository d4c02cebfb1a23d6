// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// Which of several CTs in a folder the rule of the bridge chooses, and where it must not.

#include <functional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"

#include "tests/core/imaging/ct/ct_folder.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using tissueform::testing::CtFolder;
using tissueform::testing::DicomFile;
using tissueform::testing::EnhancedPhantom;
using tissueform::testing::kInvalid;
using tissueform::testing::PhantomSeries;
using tissueform::testing::StatusIs;

using Series = std::vector<DicomFile>;

constexpr uint32_t kSeriesDescription = 0x0008103e;
constexpr uint32_t kRescaleType = 0x00281054;
constexpr uint32_t kContrastAgent = 0x00180010;
constexpr uint32_t kSliceThickness = 0x00180050;

void Set(uint32_t tag, const std::string& vr, const std::string& value, Series* series) {
  for (DicomFile& file : *series) file.Text(tag, vr, value);
}

// Long and fine enough for the rule, of study 1.9 and frame of reference 1.7.
Series Head(int number, const std::string& kernel, int slices = 80) {
  Series series = PhantomSeries({.slices = slices, .step_mm = {0, 0, 1.5}});
  Set(DicomFile::kSeriesUid, "UI", absl::StrCat("1.2.", number), &series);
  Set(DicomFile::kSeriesNumber, "IS", absl::StrCat(number), &series);
  Set(DicomFile::kStudyUid, "UI", "1.9", &series);
  Set(DicomFile::kFrameOfReference, "UI", "1.7", &series);
  Set(DicomFile::kKernel, "SH", kernel, &series);
  Set(kSeriesDescription, "LO", "Jane, soft", &series);
  return series;
}

// As a part of the patient that no other series shows.
void MoveTo(double z_mm, Series* series) {
  for (size_t i = 0; i < series->size(); ++i) {
    (*series)[i].Text(DicomFile::kPosition, "DS",
                      absl::StrCat("-30\\20\\", z_mm + 1.5 * static_cast<double>(i)));
  }
}

class SeriesChoiceTest : public CtFolder {
 protected:
  // Of the soft series, 80 slices, and the one with a bone kernel, 81, whose number is lower.
  absl::StatusOr<CtVolume> ReadBoth(const std::function<void(Series* soft, Series* bone)>& change,
                                    const CtReadOptions& options = {}) const {
    Series soft = Head(5, "H30s");
    Series bone = Head(3, "H70h", 81);
    change(&soft, &bone);
    WriteSeries(bone, "a");
    WriteSeries(soft, "b");
    return Read(options);
  }
};

void LeaveAsTheyAre(Series* /*soft*/, Series* /*bone*/) {}

TEST_F(SeriesChoiceTest, SofterOfTwoReconstructionsIsChosenAndNamed) {
  Series scout = Head(1, "", 9);
  Set(DicomFile::kImageType, "CS", "ORIGINAL\\PRIMARY\\LOCALIZER", &scout);
  WriteSeries(scout, "c");
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, ReadBoth(LeaveAsTheyAre));
  EXPECT_EQ(volume.size[2], 80);
  EXPECT_THAT(volume.provenance.notes,
              ElementsAre("chosen of 2 CT series of one study: series 5 (80 axial slices, 1.50 mm "
                          "apart, over 120 mm, soft kernel); not series 3: the chosen series has a "
                          "softer kernel; \"series_number\" in the recipe chooses another",
                          HasSubstr("ignored: series 1 (9 files; the first is a localizer")));
  CtReadOptions options;
  options.series_number = 3;
  ASSERT_OK_AND_ASSIGN(const CtVolume bone, Read(options));
  EXPECT_EQ(bone.size[2], 81);
  EXPECT_THAT(bone.provenance.notes, ElementsAre(HasSubstr("ignored: series 1")));
}

TEST_F(SeriesChoiceTest, SeriesThatTheRuleRefusesIsNotChosen) {
  struct Case {
    std::function<void(Series* soft)> spoil;
    const char* reason;
  };
  const std::vector<Case> cases = {
      {[](Series* soft) { soft->resize(59); }, "series 5: it has 59 slices, fewer than 60"},
      {[](Series* soft) { soft->erase(soft->begin() + 40); }, "series 5: 1 slices are missing"},
      {[](Series* soft) { Set(DicomFile::kImageType, "CS", "DERIVED\\PRIMARY\\MPR", soft); },
       "series 5: it is derived from another series"},
      {[](Series* soft) { Set(kSliceThickness, "DS", "5", soft); },
       "series 5: its slices are 5.00 mm thick"},
      {[](Series* soft) { Set(kRescaleType, "LO", "US", soft); },
       "series 5: it has no Hounsfield calibration"},
      {[](Series* soft) {
         Set(DicomFile::kKernel, "SH", "H70h", soft);
         Set(kContrastAgent, "LO", "Doe", soft);
       },
       "series 5: the chosen series has no contrast medium"}};
  for (const Case& one : cases) {
    ASSERT_OK_AND_ASSIGN(const CtVolume volume,
                         ReadBoth([&one](Series* soft, Series* /*bone*/) { one.spoil(soft); }));
    EXPECT_EQ(volume.size[2], 81) << one.reason;
    EXPECT_THAT(volume.provenance.notes.front(),
                AllOf(HasSubstr("one study: series 3 (81 axial"), HasSubstr(one.reason),
                      Not(HasSubstr("Doe")), Not(HasSubstr("Jane"))));
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
}

TEST_F(SeriesChoiceTest, WhereTheRuleAcceptsNoneItsReasonsAreListed) {
  EXPECT_THAT(ReadBoth([](Series* soft, Series* bone) {
                soft->resize(24);
                Set(DicomFile::kImageType, "CS", "DERIVED\\PRIMARY\\MPR", bone);
              }),
              StatusIs(kInvalid, AllOf(HasSubstr("2 CT series: series 3 (81 slices), series 5 (24"),
                                       HasSubstr("the default rule accepts none: series 3: it is "
                                                 "derived from another series; series 5: it has 24 "
                                                 "slices, fewer than 60; choose one with "
                                                 "\"series_number\""))));
}

TEST_F(SeriesChoiceTest, RuleChoosesWithinOneStudyOfOnePatientOnly) {
  struct Case {
    std::function<void(Series* soft, Series* bone)> change;
    const char* between;
  };
  const std::vector<Case> cases = {
      {[](Series* soft, Series*) { Set(DicomFile::kPatientId, "LO", "Doe2", soft); }, "patients"},
      {[](Series* soft, Series*) { Set(DicomFile::kStudyUid, "UI", "1.8", soft); }, "studies"},
      {[](Series* soft, Series* bone) {
         Set(DicomFile::kStudyUid, "UI", "", soft);
         Set(DicomFile::kStudyUid, "UI", "", bone);
       },
       "series that name no study"},
      {[](Series* soft, Series*) { Set(DicomFile::kSeriesNumber, "IS", "3", soft); },
       "scans with one series number"},
      {[](Series* soft, Series*) { MoveTo(250, soft); }, "parts that may be one scan"}};
  for (const Case& one : cases) {
    EXPECT_THAT(
        ReadBoth(one.change),
        StatusIs(
            kInvalid,
            AllOf(HasSubstr("2 CT series"),
                  HasSubstr(absl::StrCat("does not choose between ", one.between, ": series ")),
                  HasSubstr("usable, 80 axial slices"), HasSubstr("naming one of its files"))));
  }
}

TEST_F(SeriesChoiceTest, EnhancedCtIsNotJudged) {
  DicomFile enhanced = EnhancedPhantom({.slices = 9}, {0, 1, 2, 3, 4, 5, 6, 7, 8}, true);
  enhanced.Text(DicomFile::kStudyUid, "UI", "1.9").Text(DicomFile::kSeriesNumber, "IS", "7");
  Write("enhanced", enhanced.Bytes());
  EXPECT_THAT(ReadBoth(LeaveAsTheyAre),
              StatusIs(kInvalid, AllOf(HasSubstr("3 CT series"), Not(HasSubstr("rule")))));
}

TEST_F(SeriesChoiceTest, OffsetOfTheRecipeStandsForTheCalibration) {
  const auto forget = [](Series* soft, Series* bone) {
    for (Series* series : {soft, bone}) {
      for (DicomFile& file : *series) {
        file.Erase(DicomFile::kRescaleIntercept).Erase(DicomFile::kRescaleSlope);
      }
    }
  };
  EXPECT_THAT(ReadBoth(forget), StatusIs(kInvalid, HasSubstr("a recipe with hu_offset accepts")));
  CtReadOptions options;
  options.hu_offset = -1024;
  ASSERT_OK_AND_ASSIGN(const CtVolume volume, ReadBoth(forget, options));
  EXPECT_EQ(volume.size[2], 80);
}

// Where a slice without a place lies is not known: joining is not advised.
TEST_F(SeriesChoiceTest, SeriesWithAnUnplacedSliceIsNotSuggestedForJoining) {
  EXPECT_THAT(ReadBoth([](Series* soft, Series* bone) {
                MoveTo(-200, soft);
                (*soft)[40].Erase(DicomFile::kPosition);
                bone->resize(30);
              }),
              StatusIs(kInvalid, AllOf(HasSubstr("series 5: 1 slices are missing"),
                                       Not(HasSubstr("join_series")))));
}

}  // namespace
}  // namespace tissueform
