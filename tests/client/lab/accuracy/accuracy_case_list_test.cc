// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/accuracy/accuracy_case_list.h"

#include <algorithm>

#include "client/lab/accuracy/calculix_input.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

absl::StatusOr<std::string> InTestData(const std::string& name) {
  return testing::TestDataPath("plans/" + name + "/plan.json");
}

// Displacements that a case prescribes for its handles' vertices.
Positions Prescribed(const AccuracyCase& problem) {
  return ConstrainedDisplacements(problem.mesh, problem.constraints, problem.poses);
}

TEST(AccuracyCaseListTest, EveryCaseIsMadeUnderItsName) {
  for (const std::string& name : AccuracyCaseNames()) {
    ASSERT_OK_AND_ASSIGN(const AccuracyCase problem, CreateAccuracyCase(name, InTestData));
    EXPECT_EQ(problem.name, name);
    EXPECT_EQ(problem.stiffness.size(), problem.mesh.num_tets()) << name;
    EXPECT_GT(Prescribed(problem).cwiseAbs().maxCoeff(), 0) << name;
  }
}

TEST(AccuracyCaseListTest, HeadsHaveAllPlacesOfTheFaceAndNoneOfTheirVerticesIsBone) {
  for (const char* name : {"head_mandible", "head_maxilla", "head_chin"}) {
    ASSERT_OK_AND_ASSIGN(const AccuracyCase head, CreateAccuracyCase(name, InTestData));
    std::vector<std::string> places;
    for (const SkinPlace& place : head.places) places.push_back(place.name);
    EXPECT_THAT(places, ElementsAre("upper_lip", "lower_lip", "chin", "nose", "cheek_left",
                                    "cheek_right", "face"));
    const std::vector<int32_t>& constrained = head.constraints.constrained();
    for (const int32_t vertex : FindPlace(head.places, "face")->vertices) {
      ASSERT_FALSE(std::binary_search(constrained.begin(), constrained.end(), vertex)) << vertex;
    }
    EXPECT_EQ(head.views.size(), 2U);
  }
}

// The figures of the operations that docs/accuracy.md speaks of.
TEST(AccuracyCaseListTest, HeadsMoveAsFarAsTheirTitlesSay) {
  ASSERT_OK_AND_ASSIGN(const AccuracyCase mandible,
                       CreateAccuracyCase("head_mandible", InTestData));
  EXPECT_DOUBLE_EQ(Prescribed(mandible).col(1).minCoeff(), -6);
  ASSERT_OK_AND_ASSIGN(const AccuracyCase chin, CreateAccuracyCase("head_chin", InTestData));
  EXPECT_DOUBLE_EQ(Prescribed(chin).col(1).minCoeff(), -4);
  ASSERT_OK_AND_ASSIGN(const AccuracyCase maxilla, CreateAccuracyCase("head_maxilla", InTestData));
  EXPECT_NEAR(maxilla.poses[0].rotation_vector.norm(), 3 * EIGEN_PI / 180, 1e-12);
  EXPECT_DOUBLE_EQ(maxilla.poses[0].translation_mm.z(), 5);
}

// Left and right of the patient: what the tables name must not be mirrored.
TEST(AccuracyCaseListTest, TheFaceLooksAlongMinusYAndItsLeftIsPlusX) {
  ASSERT_OK_AND_ASSIGN(const AccuracyCase head, CreateAccuracyCase("head_chin", InTestData));
  const auto middle = [&](const std::string& name) -> Eigen::RowVector3d {
    return head.mesh.positions()(FindPlace(head.places, name)->vertices, Eigen::all)
        .colwise()
        .mean();
  };
  EXPECT_GT(middle("cheek_left").x(), middle("nose").x() + 20);
  EXPECT_LT(middle("cheek_right").x(), middle("nose").x() - 20);
  EXPECT_LT(middle("nose").y(), middle("cheek_left").y() - 20);
  EXPECT_GT(middle("nose").z(), middle("upper_lip").z());
  EXPECT_GT(middle("upper_lip").z(), middle("lower_lip").z());
  EXPECT_GT(middle("lower_lip").z(), middle("chin").z());
}

TEST(AccuracyCaseListTest, MeshesWithoutPlacesAreSolvedAtAllRatios) {
  ASSERT_OK_AND_ASSIGN(const AccuracyCase tongue, CreateAccuracyCase("tongue", InTestData));
  EXPECT_THAT(tongue.places, IsEmpty());
  EXPECT_THAT(tongue.poisson_ratios, ElementsAre(0.0, 0.3, 0.45, 0.49));
}

TEST(AccuracyCaseListTest, UnknownCaseAndMissingPlanAreRefused) {
  EXPECT_TRUE(absl::IsNotFound(CreateAccuracyCase("jelly", InTestData).status()));
  const auto nowhere = [](const std::string& name) -> absl::StatusOr<std::string> {
    return absl::NotFoundError("no plan " + name);
  };
  EXPECT_THAT(CreateAccuracyCase("head_chin", nowhere).status().message(), HasSubstr("head_chin"));
}

}  // namespace
}  // namespace tissueform
