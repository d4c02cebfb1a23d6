// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <filesystem>
#include <fstream>
#include <string>

#include "core/planning/plan_io.h"
#include "tests/testing/status_matchers.h"

// A plan and the mesh that it names, in folders and behind links.
namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using tissueform::testing::IsOk;
using tissueform::testing::StatusIs;

class PlanFolderTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    root_ = std::filesystem::path(::testing::TempDir()) / "plan_folder_test" / info->name();
    std::filesystem::remove_all(root_);
    std::filesystem::create_directories(root_ / "plan" / "meshes");
    std::filesystem::create_directories(root_ / "secret");
    for (const char* mesh : {"plan/a.vtu", "plan/a.node", "plan/meshes/a.vtu", "secret/a.vtu"}) {
      std::ofstream(root_ / mesh) << "mesh";
    }
  }
  void TearDown() override { std::filesystem::remove_all(root_); }

  absl::StatusOr<Plan> Read(const std::string& mesh, bool allow_outside = false) const {
    const std::filesystem::path path = root_ / "plan" / "plan.json";
    std::ofstream(path) << R"({"format": "tissueform-plan", "version": 1, "unit": "mm",
      "coordinate_system": "LPS", "mesh": ")"
                        << mesh << R"(", "stiffness": {"uniform": 1}, "fixed": {"vertices": [0]},
      "handles": [{"name": "h", "region": {"vertices": [1]}}]})";
    return ReadPlan(path.string(), {.allow_outside = allow_outside});
  }

  std::filesystem::path root_;
};

auto IsOutside() {
  return StatusIs(absl::StatusCode::kPermissionDenied,
                  AllOf(HasSubstr("plan.json"), HasSubstr("--allow-outside")));
}

TEST_F(PlanFolderTest, MeshInOrBelowTheFolderIsTaken) {
  EXPECT_THAT(Read("a.vtu"), IsOk());
  EXPECT_THAT(Read("meshes/a.vtu"), IsOk());
  EXPECT_THAT(Read("meshes/../a.vtu"), IsOk());
  EXPECT_THAT(Read((root_ / "plan" / "a.vtu").string()), IsOk());
}

TEST_F(PlanFolderTest, MissingMeshIsLeftForTheReaderToReport) {
  EXPECT_THAT(Read("missing/a.vtu"), IsOk());
}

TEST_F(PlanFolderTest, MeshThroughDotsOrAnAbsolutePathIsRefused) {
  EXPECT_THAT(Read("../secret/a.vtu"), IsOutside());
  EXPECT_THAT(Read("meshes/../../secret/a.vtu"), IsOutside());
  EXPECT_THAT(Read("../missing.vtu"), IsOutside());
  EXPECT_THAT(Read((root_ / "secret" / "a.vtu").string()), IsOutside());
  EXPECT_THAT(Read("/etc/passwd"), IsOutside());
}

TEST_F(PlanFolderTest, FolderWithTheSamePrefixIsOutside) {
  std::filesystem::create_directory(root_ / "plan2");
  std::ofstream(root_ / "plan2" / "a.vtu") << "mesh";
  EXPECT_THAT(Read("../plan2/a.vtu"), IsOutside());
}

TEST_F(PlanFolderTest, LinksThatLeaveTheFolderAreRefused) {
  std::filesystem::create_symlink("../secret/a.vtu", root_ / "plan" / "file.vtu");
  EXPECT_THAT(Read("file.vtu"), IsOutside());
  std::filesystem::create_directory_symlink(root_ / "secret", root_ / "plan" / "folder");
  EXPECT_THAT(Read("folder/a.vtu"), IsOutside());
  EXPECT_THAT(Read("folder/../a.vtu"), IsOk());  // lexically a.vtu, which is what is opened
}

TEST_F(PlanFolderTest, LinkWithinTheFolderIsTaken) {
  std::filesystem::create_symlink("meshes/a.vtu", root_ / "plan" / "inner.vtu");
  EXPECT_THAT(Read("inner.vtu"), IsOk());
}

TEST_F(PlanFolderTest, OtherHalfOfATetgenPairMustNotLeaveEither) {
  EXPECT_THAT(Read("a.node"), IsOk());
  std::filesystem::create_symlink("../secret/a.vtu", root_ / "plan" / "a.ele");
  EXPECT_THAT(Read("a.node"), IsOutside());
}

TEST_F(PlanFolderTest, OutsideIsTakenWhenItIsAllowed) {
  EXPECT_THAT(Read("../secret/a.vtu", /*allow_outside=*/true), IsOk());
}

TEST_F(PlanFolderTest, FolderThatIsItselfALinkIsTheFolderBehindIt) {
  ASSERT_THAT(Read("a.vtu"), IsOk());
  std::filesystem::create_directory_symlink(root_ / "plan", root_ / "alias");
  EXPECT_THAT(ReadPlan((root_ / "alias" / "plan.json").string()), IsOk());
}

}  // namespace
}  // namespace tissueform
