// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <filesystem>
#include <fstream>
#include <string>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <sys/wait.h>

#include "core/planning/case_file/case_reader.h"
#include "core/planning/case_file/viewer_file.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

// Cases and what `plan build` writes for viewers, opened by VTK and by Khronos' validator.
namespace tissueform::testing {
namespace {

constexpr int kMissing = 77;

// Files as `case pack` and `plan build` write them, under a name that glTF's readers take.
class CaseReadersTest : public CliTest {
 protected:
  void Pack(const std::string& plan) const {
    ASSERT_THAT(
        Run({"case", "pack", SourcePath("tests/data/plans/" + plan), "--out", "packed.glb"}),
        Succeeds());
  }
  int ExitCode(const std::string& command) const {
    return WEXITSTATUS(
        std::system(absl::StrCat(command, " > ", Path("others.txt"), " 2>&1").c_str()));
  }
  void WriteWhatWeFind(const std::vector<CaseSurface>& surfaces) const {
    std::ofstream stream(Path("ours"));
    for (const CaseSurface& surface : surfaces) {
      stream << surface.positions.rows() << " " << surface.triangles.rows();
      for (int axis = 0; axis < 3; ++axis) {
        stream << " " << surface.positions.col(axis).minCoeff() << " "
               << surface.positions.col(axis).maxCoeff();
      }
      stream << "\n";
    }
  }
  int OpenWithVtk(const std::string& path) const {
    const std::string check = SourcePath("tests/integration/open_case_with_vtk.py");
    return ExitCode(absl::StrCat(TISSUEFORM_PYTHON, " ", check, " ", path, " ", Path("ours")));
  }
};

class VtkCaseTest : public CaseReadersTest, public ::testing::WithParamInterface<std::string> {};

TEST_P(VtkCaseTest, FindsOurSurfacesWhereTheyAre) {
  Pack(absl::StrCat(GetParam(), "/plan.json"));
  ASSERT_OK_AND_ASSIGN(const CaseFile contents, ReadCase(Path("packed.glb")));
  WriteWhatWeFind(contents.surfaces);
  const int exit_code = OpenWithVtk(Path("packed.glb"));
  if (exit_code == kMissing) GTEST_SKIP() << "python3-vtk9 is missing";
  EXPECT_EQ(exit_code, 0) << Read("others.txt");
}

// With the whole head's surfaces beside the mesh, and without.
INSTANTIATE_TEST_SUITE_P(Plans, VtkCaseTest, ::testing::Values("head", "three_segments", "bar"),
                         [](const auto& plan) { return plan.param; });

TEST_F(CaseReadersTest, VtkReadsTheViewerFileOfPlanBuild) {
  const std::string path = SourcePath(absl::StrCat("tests/data/plans/head/", kViewerFile));
  ASSERT_OK_AND_ASSIGN(const ViewerFile viewer, ReadViewer(path));
  WriteWhatWeFind(viewer.surfaces);
  const int exit_code = OpenWithVtk(path);
  if (exit_code == kMissing) GTEST_SKIP() << "python3-vtk9 is missing";
  EXPECT_EQ(exit_code, 0) << Read("others.txt");
}

TEST_F(CaseReadersTest, GltfValidatorReportsNoErrors) {
  const std::string modules = SourcePath("deploy/protocol_tools/node_modules");
  if (!std::filesystem::exists(modules + "/gltf-validator")) {
    GTEST_SKIP() << "gltf-validator is missing: deploy/install_protocol_tools.sh installs it";
  }
  const auto errors = [&](const std::string& path) {
    return ExitCode(absl::StrCat("node ", SourcePath("tests/integration/validate_gltf.js"), " ",
                                 modules, " ", path));
  };
  for (const char* plan : {"head/plan.json", "three_segments/plan.json"}) {
    Pack(plan);
    EXPECT_EQ(errors(Path("packed.glb")), 0) << Read("others.txt");
    std::filesystem::remove(Path("packed.glb"));
  }
  EXPECT_EQ(errors(SourcePath(absl::StrCat("tests/data/plans/head/", kViewerFile))), 0)
      << Read("others.txt");
  // It does find what is wrong.
  Write("broken.glb", "glTF");
  EXPECT_NE(errors(Path("broken.glb")), 0);
}

}  // namespace
}  // namespace tissueform::testing
