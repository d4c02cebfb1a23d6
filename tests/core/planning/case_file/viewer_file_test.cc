// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/case_file/viewer_file.h"

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/planning/case_file/case_reader.h"
#include "core/planning/case_file/case_writer.h"
#include "tests/core/planning/case_file/sample_case.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::kInvalid;
using testing::StatusIs;

ViewerFile SampleViewer() {
  const CaseFile contents = SampleCase();
  ViewerFile viewer{.mesh_file_sha256 = std::string(64, 'b'),
                    .surfaces = contents.surfaces,
                    .landmarks = contents.landmarks,
                    .head_frame = contents.head_frame};
  for (CaseSurface& surface : viewer.surfaces) {
    surface.follows.reset();
    surface.regions.clear();
  }
  return viewer;
}

TEST(ViewerFileTest, EverythingComesBack) {
  const ViewerFile written = SampleViewer();
  ASSERT_OK_AND_ASSIGN(const std::string bytes, SerializeViewer(written));
  ASSERT_OK_AND_ASSIGN(const ViewerFile read, ParseViewer(bytes));
  EXPECT_EQ(read.mesh_file_sha256, written.mesh_file_sha256);
  ASSERT_EQ(read.surfaces.size(), 2U);
  EXPECT_EQ(read.surfaces[1].positions, written.surfaces[1].positions);
  EXPECT_EQ(read.surfaces[1].handle, "top");
  ASSERT_EQ(read.landmarks.size(), 2U);
  EXPECT_EQ(read.landmarks[1].skin_vertex, 5);
  EXPECT_EQ(read.head_frame.source, "recipe");
}

TEST(ViewerFileTest, TheSameContentsGiveTheSameBytes) {
  EXPECT_EQ(*SerializeViewer(SampleViewer()), *SerializeViewer(SampleViewer()));
}

TEST(ViewerFileTest, CasesAndViewerFilesAreNotTakenForEachOther) {
  ASSERT_OK_AND_ASSIGN(const std::string viewer, SerializeViewer(SampleViewer()));
  EXPECT_THAT(ParseCase(viewer), StatusIs(kInvalid, HasSubstr("TISSUEFORM_case")));
  ASSERT_OK_AND_ASSIGN(const std::string packed, SerializeCase(SampleCase()));
  EXPECT_THAT(ParseViewer(packed), StatusIs(kInvalid, HasSubstr("TISSUEFORM_viewer")));
}

TEST(ViewerFileTest, SurfacesThatFollowAMeshAreRefused) {
  ViewerFile viewer = SampleViewer();
  viewer.surfaces = SampleCase().surfaces;
  EXPECT_THAT(SerializeViewer(viewer), StatusIs(kInvalid, HasSubstr("follows")));
}

// The bundled one, as `plan build` has written it.
TEST(ViewerFileTest, TheBundledHeadsBelongsToItsMesh) {
  const std::string folder = testing::SourcePath("tests/data/plans/head/");
  ASSERT_OK_AND_ASSIGN(const ViewerFile viewer, ReadViewer(folder + kViewerFile));
  ASSERT_OK_AND_ASSIGN(const std::string mesh_sha256, MeshFileSha256(folder + "head.vtu"));
  EXPECT_EQ(viewer.mesh_file_sha256, mesh_sha256);
  Eigen::Index triangles = 0;
  for (const CaseSurface& surface : viewer.surfaces) triangles += surface.triangles.rows();
  EXPECT_NEAR(static_cast<double>(triangles), 150'000, 5'000);
  EXPECT_EQ(viewer.surfaces.front().kind, SurfaceKind::kSkin);
  EXPECT_EQ(viewer.head_frame.source, "landmarks");
}

TEST(ViewerFileTest, AMeshFileThatIsNotThereHasNoDigest) {
  EXPECT_THAT(MeshFileSha256("/no/such.vtu"), StatusIs(absl::StatusCode::kNotFound));
}

}  // namespace
}  // namespace tissueform
