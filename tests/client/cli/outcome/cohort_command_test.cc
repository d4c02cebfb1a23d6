// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <chrono>
#include <csignal>
#include <filesystem>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "nlohmann/json.hpp"

#include "client/cli/outcome/cohort_record.h"
#include "core/base/process/child_process.h"
#include "core/mesh/io/triangle_mesh_io.h"
#include "tests/core/planning/outcome/simulated_patient.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

namespace tissueform::testing {
namespace {

namespace fs = std::filesystem;

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;

class CohortCommandTest : public CliTest {
 protected:
  // Operated heads of one plan: each moved as planned, in another place and with other stiffness.
  void WritePatients(int count, double contrast = 1) {
    std::mt19937 random(4);
    const PreOperativeHead pre = BundledHead("head");
    for (int p = 1; p <= count; ++p) {
      const PostOperativeHead post = OperatedHead(pre, pre.problem.poses,
                                                  {.contrast = contrast,
                                                   .stiffer = contrast == 1 ? 1.0 + p : 1,
                                                   .noise_mm = contrast == 1 ? 0.1 : 0.02,
                                                   .position = RandomMove(&random, 5, 8)},
                                                  &random);
      ASSERT_THAT(WriteTriangleMesh(Path(absl::StrCat("skin", p, ".stl")),
                                    {.mesh = post.skin, .point_data = {}, .cell_data = {}}),
                  IsOk());
      ASSERT_THAT(WriteTriangleMesh(Path(absl::StrCat("bone", p, ".stl")),
                                    {.mesh = *post.bone, .point_data = {}, .cell_data = {}}),
                  IsOk());
    }
  }

  // "p1,bsso,PLAN,skin1.stl,bone1.stl".
  std::string Row(int p, const std::string& operation) const {
    return absl::StrCat("p", p, ",", operation, ",", plan_, ",skin", p, ".stl,bone", p, ".stl\n");
  }

  static std::vector<std::string> Words(int jobs) {
    return {"outcome", "cohort",           "list.csv",     "--out",
            "cohort",  "--no-pictures",    "--model",      "linear_elastic",
            "--jobs",  absl::StrCat(jobs), "--memory-gib", "6"};
  }

  // Kills the command as soon as the first patient is done.
  void KillAfterFirstPatient() const {
    ChildOptions options;
    options.program = ProgramPath("tissueform");
    options.arguments = Words(1);
    options.folder = folder_.string();
    options.output = ChildStream::Null();
    options.errors = ChildStream::Null();
    ASSERT_OK_AND_ASSIGN(const std::unique_ptr<ChildProcess> child, ChildProcess::Start(options));
    while (!fs::exists(Path("cohort/cases/p1/outcome.json"))) {
      ASSERT_FALSE(child->WaitFor(std::chrono::milliseconds(20)).has_value());
    }
    child->Signal(SIGKILL);
    EXPECT_EQ(child->Wait().signal, SIGKILL);
  }

  fs::file_time_type TimeOf(const std::string& id) const {
    return fs::last_write_time(Path("cohort/cases/" + id + "/outcome.json"));
  }

  ProcessResult WithList(const std::string& rows) const {
    Write("list.csv", rows);
    return Run(Words(1));
  }

  const std::string plan_ = SourcePath("tests/data/plans/head/plan.json");
  const std::string header_ = "case,operation,pre,post,post_bone\n";
};

TEST_F(CohortCommandTest, ResumesAfterAKillWithoutRepeatingAPatient) {
  WritePatients(2);
  Write("Smith_John.stl", "solid of no use");
  const std::string patients = header_ + Row(1, "bsso") + Row(2, "bimax");
  Write("list.csv", patients + absl::StrCat("p3,bsso,", plan_, ",Smith_John.stl,\n"));
  KillAfterFirstPatient();
  EXPECT_FALSE(fs::exists(Path("cohort/cohort.json")));
  const fs::file_time_type first = TimeOf("p1");

  const ProcessResult resumed = Run(Words(2));
  EXPECT_THAT(resumed.out, HasSubstr("3 cases: 1 finished before, 2 to run"));
  EXPECT_EQ(resumed.exit_code, 1);
  EXPECT_THAT(resumed.err,
              AllOf(HasSubstr("1 of 3 cases failed, the first is p3"), Not(HasSubstr("Smith"))));
  EXPECT_EQ(TimeOf("p1"), first);

  EXPECT_EQ(SchemaFindings("cohort.schema.json", "cohort/cohort.json", {"compared_by_operation"}),
            "");
  const auto json = nlohmann::json::parse(Read("cohort/cohort.json"));
  EXPECT_EQ(json["cases"]["compared"], 2);
  ASSERT_THAT(json["failed"], SizeIs(1));
  const auto& face = json["distances"][0];
  EXPECT_EQ(face["operation"], "all operations");
  EXPECT_EQ(face["n"], 2);
  EXPECT_LT(face["mean_mm"].get<double>(), 0.5);
  EXPECT_THAT(Read("cohort/cohort.csv"), HasSubstr("p2,bimax,upper_lip,linear_elastic,real,"));
  const std::string html = Read("cohort/cohort.html");
  EXPECT_THAT(html, AllOf(HasSubstr("not a medical device"), HasSubstr("<svg"),
                          HasSubstr("Paired tests between models, bimax")));
  for (const std::string file : {"cohort.html", "cohort.json", "cohort.csv", "cases/p2.json"}) {
    const std::string text = Read("cohort/" + file);
    EXPECT_THAT(
        text, AllOf(Not(HasSubstr("Smith")), Not(HasSubstr("skin1")), Not(HasSubstr("plan.json"))))
        << file;
  }

  Write("list.csv", patients);
  fs::last_write_time(Path("skin2.stl"), fs::file_time_type::clock::now());
  const fs::file_time_type second = TimeOf("p2");
  const ProcessResult changed = Run(Words(1));
  EXPECT_EQ(changed.exit_code, 0) << changed.err;
  EXPECT_THAT(changed.out, HasSubstr("p2 runs again: its inputs changed"));
  EXPECT_EQ(TimeOf("p1"), first);
  EXPECT_GT(TimeOf("p2"), second);
}

// The patients' tissues differ twice as much as the plan says, by another model.
TEST_F(CohortCommandTest, IsCalibratedLeavingOneOut) {
  WritePatients(3, 2);
  Write("list.csv", header_ + Row(1, "bsso") + Row(2, "bsso") + Row(3, "bsso"));
  std::vector<std::string> words = Words(2);
  words.emplace_back("--calibrate");
  const ProcessResult run = Run(words);
  ASSERT_EQ(run.exit_code, 0) << run.err;

  EXPECT_EQ(SchemaFindings("outcome.schema.json", "cohort/cases/p1/outcome.json"), "");
  const auto patient = nlohmann::json::parse(Read("cohort/cases/p1/outcome.json"));
  const auto& plans = patient["by_settings"][0];
  EXPECT_EQ(plans["settings"]["stiffness_contrast"], 1);
  EXPECT_EQ(plans["regions"].back()["mean_absolute_mm"],
            patient["predictions"][0]["regions"].back()["predicted_to_real"]["mean_absolute_mm"]);
  EXPECT_EQ(SchemaFindings("cohort.schema.json", "cohort/cohort.json", {"compared_by_operation"}),
            "");
  const auto json = nlohmann::json::parse(Read("cohort/cohort.json"));
  ASSERT_THAT(json["calibration"], SizeIs(1));
  const auto& calibration = json["calibration"][0];
  EXPECT_EQ(calibration["cases"], 3);
  EXPECT_EQ(calibration["next_patient"]["stiffness_contrast"], 2);
  int cases = 0;
  for (const auto& chosen : calibration["chosen"]) cases += chosen["cases"].get<int>();
  EXPECT_EQ(cases, 3);
  bool has_face = false;
  for (const auto& region : calibration["regions"]) {
    if (region["region"] != "face") continue;
    has_face = true;
    EXPECT_LT(region["calibrated_mean_mm"], region["plan_mean_mm"]);
    EXPECT_EQ(region["pairs"], 3);
  }
  EXPECT_TRUE(has_face);
  EXPECT_THAT(Read("cohort/cohort.html"),
              AllOf(HasSubstr("Calibration, all operations"), HasSubstr("leave-one-out")));
}

TEST_F(CohortCommandTest, BadListsAreRefusedInOneLineBeforeAnyWork) {
  const std::string row = absl::StrCat("p1,bsso,", plan_, ",", plan_, ",\n");
  const auto fails = [](const std::string& words) { return FailsWith(1, HasSubstr(words)); };
  EXPECT_THAT(WithList(""), fails("no cases"));
  EXPECT_THAT(WithList(header_), fails("no cases"));
  EXPECT_THAT(WithList("case,pre,post\n"), fails("line 1: missing columns: operation"));
  EXPECT_THAT(WithList("case,operation,pre,post,patient\n"),
              fails("line 1: column 5 is not one of case, operation"));
  EXPECT_THAT(WithList("case;operation;pre;post\n"), fails("separate columns with commas"));
  EXPECT_THAT(WithList("case,case\n"), fails("\"case\" is there twice"));
  EXPECT_THAT(WithList(header_ + row + "\n" + row), fails("line 4: same case as in line 2"));
  EXPECT_THAT(WithList(header_ + "../p1,bsso,a,b,\n"), fails("line 2: \"case\" must be 1 to 64"));
  EXPECT_THAT(WithList(header_ + "p1,le fort,a,b,\n"), fails("line 2: \"operation\" must be"));
  EXPECT_THAT(WithList(header_ + "p1,bsso,a\n"), fails("line 2: expected 5 cells, found 3"));
  EXPECT_THAT(WithList(header_ + "p1,bsso,\"a,b,\n"), fails("line 2: a quotation mark"));
  EXPECT_THAT(WithList(header_ + "p1,bsso,,b,\n"), fails("line 2: \"pre\" is empty"));
  EXPECT_THAT(WithList(header_ + row + "p2,bsso,a,b,\np3,bsso," + plan_ + ",\"Smith, J\",c\n"),
              FailsWith(1, AllOf(HasSubstr("line 3 (pre), line 3 (post), line 4 (post), "
                                           "line 4 (post_bone)"),
                                 Not(HasSubstr("Smith")))));
  EXPECT_FALSE(fs::exists(Path("cohort")));
}

TEST_F(CohortCommandTest, WrongUseIsRefused) {
  const std::string row = absl::StrCat("p1,bsso,", plan_, ",", plan_, ",\n");
  fs::create_directory(Path("cohort"));
  Write("cohort/letter.txt", "mine");
  EXPECT_THAT(WithList(header_ + row), FailsWith(1, HasSubstr("not a cohort's")));
  EXPECT_EQ(Read("cohort/letter.txt"), "mine");
  EXPECT_THAT(
      Run({"outcome", "cohort", "list.csv", "--out", "new", "--jobs", "8", "--memory-gib", "4"}),
      FailsWith(1, HasSubstr("fewer --jobs or more --memory-gib")));
  EXPECT_THAT(Run({"outcome", "cohort", "list.csv", "--out", "list.csv"}),
              FailsWith(1, HasSubstr("--out list.csv is a file; name a new folder")));
  EXPECT_THAT(Run({"outcome", "cohort", "missing.csv", "--out", "new"}),
              FailsWith(1, HasSubstr("missing.csv")));
  EXPECT_THAT(Run({"outcome", "cohort", "list.csv"}), FailsWith(2, HasSubstr("--out")));
  EXPECT_THAT(Run({"outcome", "--pre", plan_, "--out", "new"}), FailsWith(2, HasSubstr("--post")));
  EXPECT_FALSE(fs::exists(Path("new")));
}

TEST(CohortRecordTest, NothingOfAPathIsInAMessage) {
  CohortCase row;
  row.pre = "/data/Smith John/plan.json";
  row.post = "/data/ct of Smith";
  EXPECT_EQ(WithoutPaths("cannot read /data/ct of Smith/IM 1.dcm: too short", row),
            "cannot read post: too short");
  EXPECT_EQ(WithoutPaths("plan /data/Smith John/plan.json has no viewer.glb beside its mesh", row),
            "plan pre has no viewer.glb beside its mesh");
  EXPECT_EQ(WithoutPaths("mesh /data/Smith John/of Smith.vtu: line 3", row), "mesh pre: line 3");
  EXPECT_EQ(WithoutPaths("/data/Smith John/plan.json and /data/Smith John/a.vtu", row),
            "pre and pre");
  row.post = "/data/ct";
  EXPECT_EQ(WithoutPaths("surface /data/ct_Smith.stl: line 3", row), "surface post: line 3");
}

}  // namespace
}  // namespace tissueform::testing
