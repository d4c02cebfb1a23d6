// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <filesystem>
#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/planning/case_file/case_reader.h"
#include "core/planning/case_file/predicted_case.h"
#include "core/planning/rendering/virtual_display.h"
#include "tests/testing/meshes.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/scoped_environment.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

class CaseRenderTest : public CliTest {
 protected:
  void SetUp() override {
    CliTest::SetUp();
    WriteBar();
    std::filesystem::copy(TestDataPath("plans/bar/plan.json"), Path("plan.json"));
    ASSERT_THAT(Run({"case", "pack", "plan.json", "--out", "bar.tfcase"}).exit_code, 0);
  }
  // Every vertex of the case's mesh goes 2 mm to the left.
  std::string MovedPositions() const {
    const absl::StatusOr<CaseFile> contents = ReadCase(Path("bar.tfcase"));
    if (!contents.ok()) return "";
    FloatPositions moved = RestPositions(contents->mesh).cast<float>();
    moved.col(0).array() += 2;
    return {reinterpret_cast<const char*>(moved.data()),
            static_cast<size_t>(moved.size()) * sizeof(float)};
  }
  ProcessResult Render() const {
    // Under AddressSanitizer: Mesa's leaks, see tests/core/planning/rendering/figure_test.cc.
    const ScopedEnvironment no_leak_check("LSAN_OPTIONS", "detect_leaks=0");
    return Run({"case", "render", "bar.tfcase", "--positions", "after.f32", "--out", "pictures"});
  }
  // As PNG has it at its beginning.
  static int BigEndian(const std::string& bytes, size_t offset) {
    int value = 0;
    for (size_t i = 0; i < 4; ++i) value = value * 256 + static_cast<uint8_t>(bytes[offset + i]);
    return value;
  }
};

TEST_F(CaseRenderTest, ThreeViewsAreDrawn) {
  if (absl::IsNotFound(VirtualDisplay::Open().status())) GTEST_SKIP() << "no display and no Xvfb";
  Write("after.f32", MovedPositions());
  const ProcessResult result = Render();
  ASSERT_THAT(result, Succeeds());
  for (const char* name : {"front.png", "left.png", "three_quarter.png"}) {
    const std::string png = Read(std::string("pictures/") + name);
    ASSERT_THAT(png, StartsWith("\x89PNG")) << name;
    EXPECT_EQ(BigEndian(png, 16), 1024) << name;
    EXPECT_EQ(BigEndian(png, 20), 1024) << name;
    EXPECT_THAT(result.out, HasSubstr(name));
  }
}

TEST_F(CaseRenderTest, PositionsOfAnotherMeshAreRefused) {
  Write("after.f32", MovedPositions() + "more");
  EXPECT_THAT(Render(), FailsWith(1, HasSubstr("name the positions of a prediction of this case")));
  EXPECT_FALSE(std::filesystem::exists(Path("pictures")));
}

TEST_F(CaseRenderTest, RefusesAPositionThatIsNotANumber) {
  std::string positions = MovedPositions();
  ASSERT_FALSE(positions.empty());
  positions.replace(0, 4, "\xff\xff\xff\xff");
  Write("after.f32", positions);
  EXPECT_THAT(Render(), FailsWith(1, HasSubstr("not a number")));
}

TEST_F(CaseRenderTest, AFolderThatHoldsSomethingIsLeftAlone) {
  std::filesystem::create_directory(Path("pictures"));
  Write("pictures/mine.txt", "mine");
  Write("after.f32", MovedPositions());
  EXPECT_EQ(Render().exit_code, 1);
  EXPECT_EQ(Read("pictures/mine.txt"), "mine");
  EXPECT_FALSE(std::filesystem::exists(Path("pictures/front.png")));
}

}  // namespace
}  // namespace tissueform::testing
