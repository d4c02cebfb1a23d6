// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/labels/segment_names.h"

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/imaging/labels/label_facts.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;
constexpr auto kInvalid = absl::StatusCode::kInvalidArgument;

TEST(SegmentNamesTest, KnowsTheConventionsByName) {
  const auto is = [](const char* name) {
    const auto named = StructureOfName(name);
    return named ? std::string(StructureKey(named->structure)) : "";
  };
  EXPECT_EQ(is("Maxilla & Upper Skull"), "skull");
  EXPECT_EQ(is("Mandible"), "mandible");
  EXPECT_EQ(is("Upper Teeth"), "upper_teeth");
  EXPECT_EQ(is("teeth_lower"), "lower_teeth");
  EXPECT_EQ(is("sinus_frontal"), "sinus");
  EXPECT_EQ(is("head"), "head");
  EXPECT_EQ(is("vertebrae_C3"), "spine");
  EXPECT_EQ(is("face"), "");  // TotalSegmentator's mask to hide a face, not the skin
  EXPECT_EQ(is("tumor"), "");
  EXPECT_EQ(StructureOfName("Inferior alveolar canal, right")->side, Side::kRight);
  for (int s = 0; s < kNumStructures; ++s) {
    EXPECT_EQ(StructureOfKey(StructureKey(static_cast<Structure>(s))), static_cast<Structure>(s));
  }
}

LabelSegment Numbered(int value, int64_t voxels, double z_mm) {
  LabelSegment segment;
  segment.value = value;
  segment.voxels = voxels;
  segment.middle_mm.z() = z_mm;
  return segment;
}

struct Named {
  absl::Status status;
  std::vector<LabelSegment> segments;
  std::vector<std::string> notes;
};

Named Assign(std::vector<LabelSegment> segments, const std::string& convention = "") {
  LabelReadOptions options;
  options.convention = convention;
  Named named;
  named.segments = std::move(segments);
  named.status = AssignStructures(options, std::vector<SegmentFacts>(named.segments.size()), 1,
                                  &named.segments, &named.notes);
  return named;
}

TEST(SegmentNamesTest, DistinguishesNumberingConventionsBySizeAndPlace) {
  const Named dental = Assign({Numbered(1, 9000, 50), Numbered(2, 4000, 0), Numbered(3, 500, 12),
                               Numbered(4, 450, 8), Numbered(5, 20, -2)});
  EXPECT_THAT(dental.status, IsOk());
  EXPECT_EQ(dental.segments[0].structure, Structure::kSkull);
  EXPECT_THAT(dental.notes[0], HasSubstr("DentalSegmentator"));

  const Named seven = Assign({Numbered(1, 4000, 0), Numbered(2, 450, 8), Numbered(3, 9000, 50),
                              Numbered(4, 90000, 30), Numbered(5, 800, 30), Numbered(7, 500, 12)});
  EXPECT_THAT(seven.status, IsOk());
  EXPECT_EQ(seven.segments[3].structure, Structure::kHead);

  const Named six = Assign({Numbered(1, 4000, 0), Numbered(2, 450, 8), Numbered(3, 9000, 50),
                            Numbered(4, 800, 30), Numbered(5, 300, 70), Numbered(6, 500, 12)});
  EXPECT_THAT(six.status, IsOk());
  EXPECT_EQ(six.segments[5].structure, Structure::kUpperTeeth);
  EXPECT_THAT(six.notes[0], HasSubstr("six labels"));
}

TEST(SegmentNamesTest, AsksWhereNumbersFitSeveralConventionsOrNone) {
  const std::vector<LabelSegment> three = {Numbered(1, 4000, 0), Numbered(2, 450, 8),
                                           Numbered(3, 9000, 50)};
  EXPECT_THAT(Assign(three).status, StatusIs(kInvalid, HasSubstr("more than one convention")));
  const Named stated = Assign(three, "totalsegmentator");
  EXPECT_THAT(stated.status, IsOk());
  EXPECT_EQ(stated.segments[2].structure, Structure::kSkull);
  EXPECT_THAT(Assign({Numbered(117, 10, 0)}).status,
              StatusIs(kInvalid, HasSubstr("no known convention")));
}

TEST(SegmentNamesTest, NamesFromOutsideBecomeShortAndPrintable) {
  EXPECT_EQ(PrintableName(" jaw\n\x1b[31m\"\xff "), "jaw??[31m??");
  EXPECT_EQ(PrintableName(std::string(100, 'a')).size(), 40U);
}

TEST(SegmentNamesTest, ListsUnknownSegments) {
  std::vector<LabelSegment> segments = {Numbered(1, 1, 0)};
  segments[0].name = "tumor";
  std::vector<std::string> notes;
  EXPECT_THAT(AssignStructures({}, {{"tumor", {}}}, 1, &segments, &notes),
              StatusIs(kInvalid, HasSubstr("none of its 1 segments is known: 1 (tumor); state")));
  LabelReadOptions options;
  options.names = {{Structure::kSkull, "Bone", {}}};
  EXPECT_THAT(AssignStructures(options, {{"tumor", {}}}, 1, &segments, &notes),
              StatusIs(kInvalid, HasSubstr("has the name \"Bone\" for skull")));
}

TEST(LabelFactsTest, SkipsMalformedEntries) {
  const FactsByLabel nrrd = FactsOfNrrd({{"Segment0_Name", "a"},
                                         {"Segment0_LabelValue", "x"},
                                         {"Segment1_Name", "b"},
                                         {"Segment1_LabelValue", "3"},
                                         {"Segment1_Tags", "TerminologyEntry:~~~^^^^~"}});
  ASSERT_EQ(nrrd.size(), 1U);
  EXPECT_EQ(nrrd.at({0, 3}).name, "b");
  EXPECT_TRUE(nrrd.at({0, 3}).codes.empty());
  EXPECT_TRUE(FactsOfNifti("<Label Key=\"").empty());
  EXPECT_EQ(FactsOfNifti("<Label Key=\"7\">jaw</Label>").at({0, 7}).name, "jaw");
}

}  // namespace
}  // namespace tissueform::testing
