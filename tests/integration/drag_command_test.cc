// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_replace.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/integration/served_cli_test.h"
#include "tests/testing/file_bytes.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/test_paths.h"

// `tissueform drag` as a real program with a real server: with answers of its own beside it.
namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;

const std::string kBarFolder = SourcePath("tests/data/plans/bar/");

class DragCommandTest : public ServedCliTest {
 protected:
  // 0.4 s at 10 poses a second: five poses with the first.
  ProcessResult Drag(const std::string& plan, std::vector<std::string> words) const {
    words.insert(words.begin(), {"drag", plan, "--seconds", "0.4", "--rate", "10"});
    words.insert(words.end(), {"--server", server_->address()});
    return Run(words);
  }

  // The bar's plan with changes of its text; returns its name.
  std::string Changed(const std::vector<std::pair<std::string, std::string>>& changes) const {
    const std::string text = BytesOfFile(kBarFolder + "plan.json");
    std::string changed = absl::StrReplaceAll(text, changes);
    EXPECT_NE(changed, text);
    WriteBar();
    Write("changed.json", changed);
    return "changed.json";
  }
};

TEST_F(DragCommandTest, LocalOptionAnswersEveryPoseLocallyToo) {
  const ProcessResult drag = Drag(kBarFolder + "plan.json", {"--local"});
  EXPECT_THAT(drag, Succeeds());
  EXPECT_THAT(drag.out,
              AllOf(ContainsRegex("also answered locally: [1-9][0-9]* columns, [0-9.]+ MB"),
                    HasSubstr("5 poses, "), HasSubstr("answered locally: 5 poses, 0 beyond"),
                    ContainsRegex("prepared range; [0-9.]+ ms \\(p50\\)")));
}

TEST_F(DragCommandTest, AnswersNothingLocallyByDefault) {
  const ProcessResult drag = Drag(kBarFolder + "plan.json", {});
  EXPECT_THAT(drag, Succeeds());
  EXPECT_THAT(drag.out, AllOf(HasSubstr("5 poses, "), Not(HasSubstr("answered locally"))));
}

TEST_F(DragCommandTest, CountsPosesThatTheServerAloneAnswers) {
  const ProcessResult drag = Drag(Changed({{"[0, 0, 45]", "[0, 0, 400]"}}), {"--local"});
  EXPECT_THAT(drag, Succeeds());
  EXPECT_THAT(drag.out,
              ContainsRegex("answered locally: [1-4] poses, [1-4] beyond the prepared range"));
}

TEST_F(DragCommandTest, AModelWithoutPreparedAnswersIsRefusedInOneLine) {
  const ProcessResult drag =
      Drag(Changed({{"\"model\": \"gradient_field\"", "\"model\": \"arap\""}}), {"--local"});
  EXPECT_THAT(drag, FailsWith(1, HasSubstr("no prepared answers; omit --local")));
}

}  // namespace
}  // namespace tissueform::testing
