// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <set>

#include "absl/strings/str_cat.h"
#include "nlohmann/json.hpp"

#include "core/base/instruction_set.h"
#include "tests/testing/run_tissueform.h"

namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

using BenchTest = CliTest;

TEST_F(BenchTest, TheSmallestBarGivesEveryRow) {
  const ProcessResult result =
      Run({"bench", "--mesh", "1", "--repetitions", "1", "--json", "bench.json"});
  ASSERT_THAT(result, Succeeds());
  EXPECT_THAT(result.out, AllOf(HasSubstr("solve 3"), HasSubstr("targets")));

  const auto report = nlohmann::json::parse(Read("bench.json"));
  for (const char* key :
       {"machine", "compiler", "commit", "instruction_sets", "threads", "memory", "targets"}) {
    EXPECT_TRUE(report.contains(key)) << key;
  }
  std::set<std::string> works;
  for (const auto& row : report.at("rows")) {
    works.insert(row.at("work").get<std::string>());
    EXPECT_EQ(row.at("mesh"), "10x10x20");
    EXPECT_EQ(row.at("vertices"), 2541);
    EXPECT_EQ(row.at("tets"), 12000);
    EXPECT_GT(row.at("ours_seconds").get<double>(), 0);
    EXPECT_GT(row.at("bytes").get<int64_t>(), 0);
    EXPECT_EQ(row.at("peer") == "-", row.at("peer_seconds").is_null());
    EXPECT_EQ(row.at("ratio").is_null(), row.at("peer_seconds").is_null());
  }
  std::set<std::string> expected = {"read",
                                    "assemble",
                                    "local step",
                                    "estimated iteration",
                                    "estimated answer",
                                    "analyze",
                                    "factorize",
                                    "analyze + factorize",
                                    "solve 3",
                                    "basis preparation",
                                    "basis preparation, 3 handles",
                                    "elastic int16 encoding",
                                    "elastic preparation, contact",
                                    "neo-Hookean preparation"};
  for (const InstructionSet set : SupportedInstructionSets()) {
    const bool is_widest = set == SupportedInstructionSets().front();
    const std::string on = is_widest ? "" : absl::StrCat(" [", InstructionSetName(set), "]");
    for (const char* frame : {"basis frame", "basis frame, 3 handles", "elastic frame",
                              "elastic frame, contact", "neo-Hookean frame"}) {
      expected.insert(absl::StrCat(frame, on));
    }
  }
  EXPECT_EQ(works, expected);
  const auto& memory = report.at("memory").at(0);
  EXPECT_GT(memory.at("peak_bytes"), memory.at("factor_bytes"));
}

TEST_F(BenchTest, FramesAreTimedOnTheChosenInstructionSetAlone) {
  const ProcessResult result =
      Run({"bench", "--mesh", "1", "--repetitions", "1", "--isa", "baseline"});
  EXPECT_THAT(result, Succeeds());
  EXPECT_THAT(result.out, AllOf(HasSubstr("; baseline; "), HasSubstr("basis frame "),
                                Not(HasSubstr("basis frame ["))));
}

TEST_F(BenchTest, WrongUseIsOneLineAndExitCodeTwo) {
  EXPECT_THAT(Run({"bench", "--mesh", "9"}), FailsWith(2, HasSubstr("--mesh")));
  EXPECT_THAT(Run({"bench", "--repetitions", "0"}), FailsWith(2, HasSubstr("--repetitions")));
  EXPECT_THAT(Run({"bench", "--isa", "mmx"}), FailsWith(2, HasSubstr("--isa")));
  EXPECT_THAT(Run({"bench", "--fast"}), FailsWith(2, HasSubstr("tissueform bench --help")));
  EXPECT_THAT(Files(), IsEmpty());
}

TEST_F(BenchTest, TheExitCodeIsThatOfTheBenchmarks) {
  EXPECT_THAT(Run({"bench", "--mesh", "1", "--json", "missing/bench.json"}),
              FailsWith(1, HasSubstr("missing")));
}

TEST_F(BenchTest, HelpTeachesByExamples) {
  const ProcessResult result = Run({"bench", "--help"});
  EXPECT_THAT(result, Succeeds());
  EXPECT_THAT(result.out, AllOf(HasSubstr("Examples"), HasSubstr("peer / ours")));
}

}  // namespace
}  // namespace tissueform::testing
