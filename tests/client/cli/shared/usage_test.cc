// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/testing/run_tissueform.h"

namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

using UsageTest = CliTest;

TEST_F(UsageTest, WrongUseIsOneLineAndExitCodeTwo) {
  EXPECT_THAT(Run({}), FailsWith(2, HasSubstr("tissueform --help")));
  EXPECT_THAT(Run({"frobnicate"}), FailsWith(2, HasSubstr("frobnicate")));
  EXPECT_THAT(Run({"mesh"}), FailsWith(2, HasSubstr("tissueform mesh --help")));
  EXPECT_THAT(Run({"mesh", "check"}), FailsWith(2, HasSubstr("MESH")));
  EXPECT_THAT(Run({"mesh", "check", "a.vtu", "b.vtu"}), FailsWith(2, HasSubstr("b.vtu")));
  EXPECT_THAT(Run({"plan", "check"}), FailsWith(2, HasSubstr("PLAN")));
  EXPECT_THAT(Run({"plan", "check", "--frob"}), FailsWith(2, HasSubstr("--frob")));
  EXPECT_THAT(Run({"deform", "plan.json"}), FailsWith(2, HasSubstr("--out")));
  EXPECT_THAT(Run({"deform", "plan.json", "--out", "out.obj"}),
              FailsWith(2, HasSubstr("must end with .vtu")));
  EXPECT_THAT(Run({"deform", "plan.json", "--out", "out.vtu", "--model", "spring"}),
              FailsWith(2, HasSubstr("spring")));
  EXPECT_THAT(Run({"compare", "a.vtu"}), FailsWith(2, HasSubstr("B: is required")));
  EXPECT_THAT(Files(), IsEmpty());
}

TEST_F(UsageTest, NumbersAreFinite) {
  EXPECT_THAT(Run({"drag", "plan.json", "--server", "localhost:1", "--rate", "nan"}),
              FailsWith(2, HasSubstr("--rate: nan")));
  EXPECT_THAT(Run({"mesh", "generate", "a.stl", "--out", "a.vtu", "--radius-edge", "nan"}),
              FailsWith(2, HasSubstr("--radius-edge: nan")));
}

TEST_F(UsageTest, SolverThreadsOutOfRangeAreRefusedInOneLine) {
  for (const char* number : {"0", "-1", "65", "1e9", "two"}) {
    EXPECT_THAT(Run({"deform", "plan.json", "--out", "out.vtu", "--solver-threads", number}),
                FailsWith(2, AllOf(HasSubstr("--solver-threads"), HasSubstr(number))));
    EXPECT_THAT(Run({"compare", "plan.json", "--solver-threads", number}),
                FailsWith(2, AllOf(HasSubstr("--solver-threads"), HasSubstr(number))));
  }
  EXPECT_THAT(Run({"compare", "a.vtu", "b.vtu", "--solver-threads", "2"}),
              FailsWith(2, HasSubstr("--solver-threads: applies to a plan")));
}

TEST_F(UsageTest, HelpTeachesByExamples) {
  EXPECT_THAT(Run({"--help"}).out, AllOf(HasSubstr("deform"), HasSubstr("not a medical device")));
  const std::vector<std::vector<std::string>> commands = {
      {"mesh", "check"}, {"mesh", "generate"}, {"plan", "check"}, {"plan", "fit"},
      {"case", "pack"},  {"export"},           {"deform"},        {"compare"}};
  for (std::vector<std::string> command : commands) {
    command.emplace_back("--help");
    const ProcessResult result = Run(command);
    EXPECT_THAT(result, Succeeds());
    EXPECT_THAT(result.out, HasSubstr("Example")) << command.front();
  }
}

TEST_F(UsageTest, VersionIsPrinted) {
  const ProcessResult result = Run({"--version"});
  EXPECT_THAT(result, Succeeds());
  EXPECT_THAT(result.out, ::testing::MatchesRegex("tissueform [0-9]+\\.[0-9]+\\.[0-9]+\n"));
}

TEST_F(UsageTest, LineBreaksInNamesDoNotMakeASecondLine) {
  EXPECT_THAT(Run({"mesh", "check", "a\nb.vtu"}),
              FailsWith(1, HasSubstr("a b.vtu does not exist")));
}

}  // namespace
}  // namespace tissueform::testing
