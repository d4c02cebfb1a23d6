// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/rendering/virtual_display.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/scoped_environment.h"

namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;

class ExperimentsTest : public CliTest {};

TEST_F(ExperimentsTest, Figure1LeavesItsPictureAndItsNumbers) {
  if (const auto display = VirtualDisplay::Open(); absl::IsNotFound(display.status())) {
    GTEST_SKIP() << display.status();
  }
  // Under AddressSanitizer: the leaks of Mesa's driver, see
  // tests/core/planning/rendering/figure_test.cc.
  const ScopedEnvironment no_leak_check("LSAN_OPTIONS", "detect_leaks=0");
  const ProcessResult result = Run({"experiments", "--out", "figures", "--only", "fig1"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("fig1"));
  EXPECT_THAT(Files(), ElementsAre("figures"));
  EXPECT_THAT(Read("figures/fig1.png"), StartsWith("\x89PNG"));
  EXPECT_THAT(Read("figures/fig1.csv"),
              AllOf(StartsWith("case,volume_ratio,"), HasSubstr("\nvolume,0.85"),
                    HasSubstr("\nsurface,0.5")));
  EXPECT_THAT(Read("figures/fig1_sections.csv"),
              StartsWith("position_mm,volume,surface,notice\n0.5,"));
}

TEST_F(ExperimentsTest, UnknownNameIsWrongUseAndLeavesNothing) {
  EXPECT_THAT(Run({"experiments", "--out", "figures", "--only", "fig9"}),
              FailsWith(2, HasSubstr("fig9")));
  EXPECT_THAT(Files(), ElementsAre());
}

TEST_F(ExperimentsTest, ReportsAnUnusableFolderInOneLine) {
  Write("taken", "");
  EXPECT_THAT(Run({"experiments", "--out", "taken/figures"}),
              FailsWith(1, HasSubstr("taken/figures")));
  EXPECT_THAT(Run({"experiments", "--out", "taken"}), FailsWith(1, HasSubstr("taken")));
  EXPECT_THAT(Files(), ElementsAre("taken"));
}

TEST_F(ExperimentsTest, ReportsMissingXvfbInOneLine) {
  const ScopedEnvironment no_display("DISPLAY", nullptr);
  const ScopedEnvironment no_programs("PATH", "/nonexistent");
  EXPECT_THAT(Run({"experiments", "--out", "figures", "--only", "fig1"}),
              FailsWith(1, HasSubstr("install the package xvfb")));
}

TEST_F(ExperimentsTest, NamesMayBeGivenWithoutTheirOption) {
  EXPECT_THAT(Run({"experiments", "fig9", "--out", "figures"}), FailsWith(2, HasSubstr("fig9")));
  const ProcessResult help = Run({"experiments", "--help"});
  EXPECT_THAT(help.out, HasSubstr("accuracy"));
}

TEST_F(ExperimentsTest, RefusesAnUnknownAccuracyCaseAndListsTheKnownOnes) {
  EXPECT_THAT(
      Run({"experiments", "accuracy", "--case", "jelly", "--out", "accuracy"}),
      FailsWith(2, AllOf(HasSubstr("jelly"), HasSubstr("head_mandible"), HasSubstr("locking"))));
  EXPECT_THAT(Files(), ElementsAre());
}

}  // namespace
}  // namespace tissueform::testing
