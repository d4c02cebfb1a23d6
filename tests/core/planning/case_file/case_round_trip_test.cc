// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"

#include "core/planning/case_file/case_reader.h"
#include "core/planning/case_file/case_writer.h"
#include "core/planning/case_file/glb_container.h"
#include "tests/core/planning/case_file/sample_case.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

TEST(CaseRoundTripTest, EverythingComesBack) {
  const CaseFile written = SampleCase();
  ASSERT_OK_AND_ASSIGN(const std::string bytes, SerializeCase(written));
  ASSERT_OK_AND_ASSIGN(const CaseFile read, ParseCase(bytes));
  EXPECT_EQ(read.title, written.title);
  EXPECT_EQ(read.created, written.created);
  EXPECT_EQ(read.plan_sha256, written.plan_sha256);
  EXPECT_EQ(read.mesh.name, written.mesh.name);
  EXPECT_EQ(read.mesh.payload, written.mesh.payload);
  EXPECT_EQ(read.mesh.cell_arrays, written.mesh.cell_arrays);
  EXPECT_EQ(read.session_request, written.session_request);
  EXPECT_EQ(read.material_ranges, written.material_ranges);
  EXPECT_EQ(read.model, written.model);
  EXPECT_EQ(read.head_frame.source, "recipe");
  EXPECT_EQ(read.head_frame.origin_mm, written.head_frame.origin_mm);
  ASSERT_EQ(read.handles.size(), 1U);
  EXPECT_EQ(read.handles[0].pivot_mm, written.handles[0].pivot_mm);
  EXPECT_NEAR(read.handles[0].pose.rotation_vector.x(), 0.1, 1e-15);
  EXPECT_EQ(read.handles[0].pose.translation_mm, written.handles[0].pose.translation_mm);
  EXPECT_EQ(read.handles[0].most_translation_mm, 12);
  EXPECT_EQ(read.handles[0].most_rotation_deg, 9);
  ASSERT_EQ(read.landmarks.size(), 2U);
  EXPECT_EQ(read.landmarks[0].handle, "top");
  EXPECT_EQ(read.landmarks[1].skin_vertex, 5);
  ASSERT_EQ(read.skin_regions.size(), 1U);
  EXPECT_EQ(read.skin_regions[0].label, "Chin");
}

TEST(CaseRoundTripTest, SurfacesComeBackToTheBit) {
  const CaseFile written = SampleCase();
  ASSERT_OK_AND_ASSIGN(const std::string bytes, SerializeCase(written));
  ASSERT_OK_AND_ASSIGN(const CaseFile read, ParseCase(bytes));
  ASSERT_EQ(read.surfaces.size(), written.surfaces.size());
  for (size_t s = 0; s < read.surfaces.size(); ++s) {
    EXPECT_EQ(read.surfaces[s].name, written.surfaces[s].name);
    EXPECT_EQ(read.surfaces[s].kind, written.surfaces[s].kind);
    EXPECT_EQ(read.surfaces[s].handle, written.surfaces[s].handle);
    EXPECT_EQ(read.surfaces[s].positions, written.surfaces[s].positions);
    EXPECT_EQ(read.surfaces[s].triangles, written.surfaces[s].triangles);
    EXPECT_EQ(read.surfaces[s].regions, written.surfaces[s].regions);
    ASSERT_EQ(read.surfaces[s].follows.has_value(), written.surfaces[s].follows.has_value());
    if (!read.surfaces[s].follows) continue;
    EXPECT_EQ(read.surfaces[s].follows->vertices, written.surfaces[s].follows->vertices);
    EXPECT_EQ(read.surfaces[s].follows->weights, written.surfaces[s].follows->weights);
  }
}

TEST(CaseRoundTripTest, CaseWithoutRangesReadsBackWithoutRanges) {
  CaseFile contents = SampleCase();
  contents.material_ranges.reset();
  ASSERT_OK_AND_ASSIGN(const std::string bytes, SerializeCase(contents));
  ASSERT_OK_AND_ASSIGN(const CaseFile read, ParseCase(bytes));
  EXPECT_FALSE(read.material_ranges.has_value());
}

TEST(CaseRoundTripTest, ContactComesBackAndMakesVersionTwo) {
  CaseFile contents = SampleCase();
  ASSERT_OK_AND_ASSIGN(const std::string before, SerializeCase(contents));
  EXPECT_THAT(before, ::testing::HasSubstr("\"version\":1"));
  EXPECT_FALSE(ParseCase(before)->contact.has_value());
  contents.contact.emplace().rows = 7;
  for (const bool sticks : {false, true}) {
    if (sticks) {
      contents.contact->sticking.resize(3, 2);
      contents.contact->sticking << 2, -1, 5, 0, 6, -1;
    }
    ASSERT_OK_AND_ASSIGN(const std::string bytes, SerializeCase(contents));
    EXPECT_THAT(bytes, ::testing::HasSubstr("\"version\":2"));
    ASSERT_OK_AND_ASSIGN(const CaseFile read, ParseCase(bytes));
    ASSERT_TRUE(read.contact.has_value());
    EXPECT_EQ(read.contact->rows, 7);
    EXPECT_EQ(read.contact->sticking, contents.contact->sticking);
    EXPECT_EQ(read.session_request, contents.session_request);
  }
}

TEST(CaseRoundTripTest, ContactThatDoesNotFitTheMeshIsRefused) {
  const auto refused = [](int32_t vertex, int32_t next, int32_t region) {
    CaseFile contents = SampleCase();
    contents.contact.emplace().rows = 2;
    contents.contact->sticking.resize(2, 2);
    contents.contact->sticking << vertex, -1, next, region;
    EXPECT_THAT(SerializeCase(contents),
                testing::StatusIs(absl::StatusCode::kInvalidArgument,
                                  ::testing::HasSubstr("/contact/sticking")));
  };
  refused(-1, 3, 0);
  refused(3, 3, 0);
  refused(3, static_cast<int32_t>(SampleCase().mesh.vertex_count), 0);
  refused(3, 4, 1);
  refused(3, 4, -2);
}

// A viewer reads the beginning of the file and fetches the mesh only when a server asks for it.
TEST(CaseRoundTripTest, TheMeshComesLastAndPiecesLieAtMultiplesOf16) {
  ASSERT_OK_AND_ASSIGN(const std::string bytes, SerializeCase(SampleCase()));
  ASSERT_OK_AND_ASSIGN(const Glb glb, ParseGlb(bytes, kMaxCaseJsonBytes));
  const auto& ours = glb.root["extensions"][kCaseExtension];
  EXPECT_EQ(ours["mesh"]["payload"].get<size_t>(), glb.views.size() - 1);
  EXPECT_LT(ours["session_request"].get<size_t>(), ours["material_ranges"].get<size_t>());
  for (const absl::string_view view : glb.views) {
    EXPECT_EQ((view.data() - bytes.data()) % 16, 0);
  }
}

TEST(CaseRoundTripTest, TextWithMarkupStaysText) {
  CaseFile contents = SampleCase();
  contents.title = "<script>alert(1)</script> & \"quotes\" \xC3\xA9";
  contents.handles[0].label = "</title><img src=x onerror=alert(1)>";
  ASSERT_OK_AND_ASSIGN(const std::string bytes, SerializeCase(contents));
  ASSERT_OK_AND_ASSIGN(const CaseFile read, ParseCase(bytes));
  EXPECT_EQ(read.title, contents.title);
  EXPECT_EQ(read.handles[0].label, contents.handles[0].label);
}

TEST(CaseRoundTripTest, DoesNotWriteAnInvalidCase) {
  CaseFile contents = SampleCase();
  contents.surfaces[1].handle = "nobody";
  EXPECT_THAT(SerializeCase(contents),
              testing::StatusIs(testing::kInvalid, ::testing::HasSubstr("/surfaces/1/handle")));
}

}  // namespace
}  // namespace tissueform
