// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <filesystem>
#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "client/cli/export/page_template.h"
#include "core/planning/plan_io.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

// `tissueform export` as a program, and the page that it fills.
namespace tissueform::testing {
namespace {

namespace fs = std::filesystem;

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr char kPage[] = "<a>@TISSUEFORM-ENVELOPE@</a><b>@TISSUEFORM-PAYLOAD@</b>";

TEST(PageTemplateTest, EnvelopeAndPayloadStandWhereTheMarksWere) {
  const auto page = FillPageTemplate(kPage, {.envelope = "{}", .payload = "face"});
  EXPECT_EQ(page.value_or(""), "<a>{}</a><b>ZmFjZQ==</b>");
}

TEST(PageTemplateTest, APageWithoutItsMarksIsRefused) {
  for (const char* page : {"", "@TISSUEFORM-ENVELOPE@", "@TISSUEFORM-PAYLOAD@@TISSUEFORM-ENVELOPE@",
                           "@TISSUEFORM-ENVELOPE@@TISSUEFORM-ENVELOPE@@TISSUEFORM-PAYLOAD@"}) {
    EXPECT_THAT(FillPageTemplate(page, {.envelope = "{}", .payload = "face"}),
                StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("moving-file.html")));
  }
}

class ExportCommandTest : public CliTest {
 protected:
  void SetUp() override {
    CliTest::SetUp();
    if (!fs::exists(SourcePath("build/web/moving-file.html"))) {
      GTEST_SKIP() << "deploy/build_web.sh has not built the page";
    }
  }
  ProcessResult Export(std::vector<std::string> options) const {
    options.insert(options.begin(),
                   {"export", SourcePath("tests/data/plans/tongue/plan.json"), "--html", "t.html"});
    return Run(options);
  }
};

TEST_F(ExportCommandTest, FileIsCompleteOwnerOnlyAndOmitsThePlan) {
  const ProcessResult result = Export({});
  ASSERT_THAT(result, Succeeds());
  EXPECT_THAT(result.out, AllOf(HasSubstr("not encrypted"), HasSubstr("not a medical device"),
                                HasSubstr("photograph")));
  const std::string html = Read("t.html");
  EXPECT_THAT(html, AllOf(HasSubstr("connect-src 'none'"), HasSubstr("</html>"),
                          Not(HasSubstr("@TISSUEFORM-")), Not(HasSubstr("tongue"))));
  EXPECT_EQ(fs::status(Path("t.html")).permissions(),
            fs::perms::owner_read | fs::perms::owner_write);
}

TEST_F(ExportCommandTest, KeepsAnExistingFileWithoutOverwrite) {
  Write("t.html", "old");
  EXPECT_THAT(Export({}), FailsWith(1, AllOf(HasSubstr("t.html"), HasSubstr("--overwrite"))));
  EXPECT_EQ(Read("t.html"), "old");
  EXPECT_THAT(Export({"--overwrite"}), Succeeds());
  EXPECT_GT(Read("t.html").size(), 100'000U);
}

TEST_F(ExportCommandTest, FailedExportSaysWhyAndLeavesNoFile) {
  EXPECT_THAT(Export({"--segments", "nose"}),
              FailsWith(1, AllOf(HasSubstr("\"nose\""), HasSubstr("it has "))));
  EXPECT_THAT(Export({"--model", "arap"}),
              FailsWith(1, AllOf(HasSubstr("arap"), HasSubstr("linear_elastic"))));
  EXPECT_THAT(Export({"--model", "magic"}), FailsWith(1, HasSubstr("magic")));
  EXPECT_THAT(Export({"--title", "two\nlines"}), FailsWith(1, HasSubstr("--title")));
  EXPECT_THAT(Export({"--password-file", "none"}), FailsWith(1, HasSubstr("none")));
  Write("short", "abc");
  EXPECT_THAT(Export({"--password-file", "short"}), FailsWith(1, HasSubstr("at least 8")));
  EXPECT_THAT(Run({"export", "none.json", "--html", "t.html"}), FailsWith(1, HasSubstr("none")));
  EXPECT_THAT(Run({"export", "plan.json", "--html", "t.txt"}), FailsWith(1, HasSubstr(".html")));
  EXPECT_THAT(Run({"export", "plan.json"}), FailsWith(2, HasSubstr("--html")));
  fs::remove(Path("short"));
  EXPECT_THAT(Files(), IsEmpty());
}

// Answers of gradient_field are prepared up to 30 degrees.
TEST_F(ExportCommandTest, PlanOutOfTheModelsRangeSuggestsAnotherModel) {
  const std::string folder = SourcePath("tests/data/plans/tongue/");
  std::string plan = Read(folder + "plan.json");
  const auto replace = [&plan](const std::string& from, const std::string& to) {
    ASSERT_NE(plan.find(from), std::string::npos);
    plan.replace(plan.find(from), from.size(), to);
  };
  replace("[-20, 0, 0]", "[-40, 0, 0]");
  replace("volumetricTongue.vtu", "tongue.vtu");
  fs::copy_file(folder + "volumetricTongue.vtu", Path("tongue.vtu"));
  Write("plan.json", plan);
  EXPECT_THAT(Run({"export", "plan.json", "--html", "t.html"}),
              FailsWith(1, AllOf(HasSubstr("gradient_field"), HasSubstr("could not show"),
                                 HasSubstr("choose linear_elastic"))));
  EXPECT_FALSE(fs::exists(Path("t.html")));
  EXPECT_THAT(Run({"export", "plan.json", "--html", "t.html", "--model", "linear_elastic"}),
              Succeeds());
}

TEST_F(ExportCommandTest, WarnsAboutATitleAndEncryptsItWithAPassword) {
  Write("password", "correct horse battery");
  const ProcessResult result = Export({"--title", "Chin forward", "--password-file", "password"});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("does not name the patient"));
  EXPECT_THAT(Read("t.html"), AllOf(HasSubstr("PBKDF2-SHA-256"), Not(HasSubstr("Chin forward")),
                                    Not(HasSubstr("correct horse"))));
}

TEST_F(ExportCommandTest, HelpTeaches) {
  const ProcessResult help = Run({"export", "--help"});
  EXPECT_THAT(help, Succeeds());
  EXPECT_THAT(help.out, AllOf(HasSubstr("photograph of the"), HasSubstr("Example")));
}

}  // namespace
}  // namespace tissueform::testing
