// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cmath>
#include <random>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"

#include "client/cli/outcome/cohort_tables.h"
#include "core/planning/outcome/deviations.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

// Standard deviations that patients are drawn from.
constexpr double kFace = 0.8;
constexpr double kLip = 1.4;
constexpr double kForward = 0.9;
constexpr double kPitch = 1.3;

class CohortDeviationsTest : public CliTest {
 protected:
  // Patients of one operation, predicted by linear_elastic, whose errors are normal values times
  // `factor`.
  void AddPatients(int count, const std::string& operation, double factor) {
    std::normal_distribution<double> normal(0, factor);
    for (int p = 0; p < count; ++p) {
      const std::string id = absl::StrCat(operation, p);
      CohortCase row;
      row.id = id;
      row.operation = operation;
      results_.compared.push_back(row);
      for (const auto& [region, deviation] : {std::pair("face", kFace), std::pair("chin", kLip)}) {
        for (const char* movement : {"real", "planned"}) {
          CohortDistance distance;
          distance.id = id;
          distance.group = {
              .operation = operation, .movement = movement, .model = "linear_elastic"};
          distance.region = region;
          distance.skin.mean_absolute_mm = std::abs(deviation * normal(random_)) +
                                           (distance.group.movement == "planned" ? 10 : 0);
          results_.distances.push_back(distance);
        }
      }
      for (const auto& [number, deviation] :
           {std::pair("left_mm", 0.5), std::pair("forward_mm", kForward), std::pair("up_mm", 0.5),
            std::pair("pitch_deg", kPitch), std::pair("roll_deg", 0.5),
            std::pair("yaw_deg", 0.5)}) {
        results_.deviations.push_back({.operation = operation,
                                       .segment = "mandible",
                                       .number = number,
                                       .value = deviation * normal(random_)});
      }
    }
  }

  DeviationTable Written() {
    Write("deviations.json", DeviationFileJson(results_, "linear_elastic").dump());
    absl::StatusOr<DeviationTable> read = ReadDeviations(Path("deviations.json"));
    EXPECT_THAT(read, IsOk());
    return *std::move(read);
  }

  CohortResults results_;
  std::mt19937 random_{7};
};

TEST_F(CohortDeviationsTest, RecoversTheDistributionOfThePatients) {
  AddPatients(2000, "bsso", 1);
  AddPatients(2000, "bimax", 2);
  const DeviationTable table = Written();
  EXPECT_EQ(SchemaFindings("deviations.schema.json", "deviations.json",
                           {"", "surgery", "model_mm", "operations", "bsso", "bimax"}),
            "");
  for (const auto& [operation, factor] : {std::pair("bsso", 1.0), std::pair("bimax", 2.0)}) {
    ASSERT_OK_AND_ASSIGN(const Deviations found, DeviationsOf(table, operation));
    EXPECT_NEAR(found.ModelOf("nose") / factor, kFace, 0.04) << "no figures of its own";
    EXPECT_NEAR(found.ModelOf("chin") / factor, kLip, 0.07);
    EXPECT_NEAR(found.surgery.translation_mm[1] / factor, kForward, 0.05);
    EXPECT_NEAR(found.surgery.rotation_deg[0] / factor, kPitch, 0.07);
    EXPECT_THAT(found.source, ::testing::HasSubstr(operation));
  }
  EXPECT_NEAR(table.all.ModelOf("chin"), 1.5 * kLip, 0.1) << "as many patients with twice as much";
}

TEST_F(CohortDeviationsTest, FewPatientsKeepPublishedFigures) {
  AddPatients(static_cast<int>(kLeastForDeviations), "bsso", 1);
  AddPatients(static_cast<int>(kLeastForDeviations) - 1, "bimax", 1);
  const DeviationTable table = Written();
  EXPECT_TRUE(table.operations.contains("bsso"));
  EXPECT_FALSE(table.operations.contains("bimax"));
  EXPECT_EQ(table.all.ModelOf("upper_lip"), Deviations().ModelOf("upper_lip"));

  results_ = {};
  AddPatients(static_cast<int>(kLeastForDeviations) - 1, "bsso", 1);
  EXPECT_TRUE(DeviationFileJson(results_, "linear_elastic").empty());
  EXPECT_TRUE(DeviationFileJson(results_, "arap").empty());
}

}  // namespace
}  // namespace tissueform::testing
