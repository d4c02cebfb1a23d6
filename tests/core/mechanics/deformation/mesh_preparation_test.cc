// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/mesh_preparation.h"

#include <algorithm>
#include <numeric>
#include <random>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mechanics/deformation/arap_deformer.h"
#include "core/mechanics/deformation/create_deformer.h"
#include "core/mechanics/deformation/gradient_field_deformer.h"
#include "tests/testing/handle_problem.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::IsOk;
using testing::StatusIs;

class MeshPreparationTest : public ::testing::Test {
 protected:
  std::shared_ptr<MeshPreparation> Prepare() {
    PreparationOptions options;
    options.admission = [this](int64_t bytes) {
      ++admissions_;
      return bytes <= budget_ ? absl::OkStatus() : absl::ResourceExhaustedError("no room");
    };
    options.observer = [this](const PreparationProgress& progress) {
      reported_.push_back(progress);
    };
    return testing::PrepareMesh(mesh_, 1, options);
  }

  const TetMesh mesh_ = testing::Bar({4, 4, 8}, 2.0, 0.2);
  int admissions_ = 0;
  int64_t budget_ = int64_t{1} << 40;
  std::vector<PreparationProgress> reported_;
};

TEST_F(MeshPreparationTest, SecondModelDoesNotFactoriseAgain) {
  const auto preparation = Prepare();
  EXPECT_EQ(admissions_, 0);
  EXPECT_FALSE(preparation->has_laplacian());
  ASSERT_OK_AND_ASSIGN(const auto propagated, CreateGradientFieldDeformer(preparation, {}));
  EXPECT_EQ(admissions_, 1);
  GradientFieldOptions estimated;
  estimated.rotation = RotationMode::kEstimated;
  ASSERT_THAT(CreateGradientFieldDeformer(preparation, estimated), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto arap, CreateArapDeformer(preparation, {}));
  EXPECT_EQ(admissions_, 1);
  EXPECT_TRUE(preparation->has_laplacian());
  EXPECT_FALSE(preparation->has_elastic());

  ASSERT_THAT(preparation->Elastic(), IsOk());
  const int after_elastic = admissions_;
  ASSERT_THAT(preparation->Elastic(), IsOk());
  EXPECT_EQ(admissions_, after_elastic);
}

TEST_F(MeshPreparationTest, OneOrderOfTheVerticesServesAllFactors) {
  const auto laplacian_first = Prepare();
  EXPECT_THAT(laplacian_first->node_order(), ::testing::IsEmpty());
  ASSERT_OK_AND_ASSIGN(const PreparedLaplacian* laplacian, laplacian_first->Laplacian());
  const std::vector<int32_t> order = laplacian_first->node_order();
  std::vector<int32_t> all(mesh_.num_vertices());
  std::iota(all.begin(), all.end(), 0);
  EXPECT_THAT(order, ::testing::UnorderedElementsAreArray(all));
  ASSERT_THAT(laplacian_first->Elastic(), IsOk());
  EXPECT_EQ(laplacian_first->node_order(), order);

  // Both systems have the graph of the mesh's edges, so it does not matter which is made first:
  // what is made again from a record has the same bits.
  const auto elastic_first = Prepare();
  ASSERT_OK_AND_ASSIGN(const ElasticSystem* elastic, elastic_first->Elastic());
  EXPECT_EQ(elastic_first->node_order(), order);
  ASSERT_OK_AND_ASSIGN(const PreparedLaplacian* second, elastic_first->Laplacian());
  EXPECT_EQ(second->harmonic, laplacian->harmonic);
  EXPECT_EQ(elastic->response_columns(), laplacian_first->Elastic().value()->response_columns());
}

TEST_F(MeshPreparationTest, AnOrderThatIsGivenIsTheOneThatIsUsed) {
  const auto found = Prepare();
  ASSERT_OK_AND_ASSIGN(const ElasticSystem* best, found->Elastic());
  PreparationOptions options;
  options.node_order = found->node_order();
  std::shuffle(options.node_order.begin(), options.node_order.end(), std::mt19937(3));
  const auto given = testing::PrepareMesh(mesh_, 1, options);
  ASSERT_OK_AND_ASSIGN(const ElasticSystem* worse, given->Elastic());
  EXPECT_GT(worse->system().factorization().factor_bytes,
            best->system().factorization().factor_bytes * 3 / 2);
  EXPECT_LT((worse->response_columns() - best->response_columns()).cwiseAbs().maxCoeff(), 1e-10);
  options.node_order.pop_back();
  const auto short_by_one = testing::PrepareMesh(mesh_, 1, options);
  ASSERT_THAT(short_by_one->Elastic(), IsOk());
  EXPECT_EQ(short_by_one->node_order(), found->node_order()) << "passed over";
}

TEST_F(MeshPreparationTest, BytesHeldGrowWithPreparedParts) {
  const auto preparation = Prepare();
  const int64_t empty = preparation->bytes_held();
  ASSERT_OK_AND_ASSIGN(const auto propagated, CreateGradientFieldDeformer(preparation, {}));
  EXPECT_GT(preparation->bytes_held(), empty + propagated->preparation().factor_bytes);
  EXPECT_EQ(propagated->preparation().bytes_held,
            preparation->bytes_held() + propagated->preparation().own_bytes);
  ASSERT_THAT(preparation->Elastic(), IsOk());
  EXPECT_GT(preparation->bytes_held(), preparation->laplacian_bytes());
  for (const DeformationModel model :
       {DeformationModel::kLinearElastic, DeformationModel::kNeoHookean}) {
    DeformerOptions options;
    options.model = model;
    ASSERT_OK_AND_ASSIGN(const auto elastic, CreateDeformer(preparation, options));
    EXPECT_GT(elastic->preparation().own_bytes, 0) << "a session's budget counts it";
    EXPECT_EQ(elastic->preparation().bytes_held,
              preparation->bytes_held() + elastic->preparation().own_bytes);
  }
}

TEST_F(MeshPreparationTest, SharedAndOwnPreparationGiveTheSameAnswer) {
  const auto preparation = Prepare();
  ASSERT_OK_AND_ASSIGN(const auto shared, CreateGradientFieldDeformer(preparation, {}));
  ASSERT_OK_AND_ASSIGN(const auto own, CreateGradientFieldDeformer(mesh_, preparation->stiffness(),
                                                                   preparation->constraints(), {}));
  testing::RandomNumbers random(7);
  const auto poses = testing::RandomPoses(1, 0.7, 0.1, 10, &random);
  ASSERT_OK_AND_ASSIGN(const Deformation a, shared->Deform(poses));
  ASSERT_OK_AND_ASSIGN(const Deformation b, own->Deform(poses));
  EXPECT_EQ(a.positions, b.positions);
}

TEST_F(MeshPreparationTest, RefusedFactorMayBeAskedForAgain) {
  const auto preparation = Prepare();
  budget_ = 10;
  EXPECT_THAT(preparation->Laplacian(), StatusIs(absl::StatusCode::kResourceExhausted, "no room"));
  EXPECT_THAT(preparation->Elastic(), StatusIs(absl::StatusCode::kResourceExhausted, "no room"));
  budget_ = int64_t{1} << 40;
  EXPECT_THAT(preparation->Laplacian(), IsOk());
}

TEST_F(MeshPreparationTest, ACancelledPreparationStopsAtItsNextStageAndMayBeAskedForAgain) {
  int stages = 0;
  const auto preparation = Prepare();
  for (int stop_at = 1;; ++stop_at) {
    stages = 0;
    const Cancellation cancellation([&] { return ++stages == stop_at; });
    const absl::Status status = preparation->Elastic(cancellation).status();
    if (status.ok()) break;
    EXPECT_THAT(status, StatusIs(absl::StatusCode::kCancelled, HasSubstr("canceled")));
    EXPECT_EQ(stages, stop_at) << "nobody is asked again";
    EXPECT_FALSE(preparation->has_elastic());
  }
  EXPECT_GE(stages, 3) << "before the analysis, before the factor, before the columns";
}

TEST_F(MeshPreparationTest, EveryModelReportsItsOwnStagesInOrder) {
  for (const DeformationModel model :
       {DeformationModel::kGradientField, DeformationModel::kArap, DeformationModel::kLinearElastic,
        DeformationModel::kNeoHookean}) {
    SCOPED_TRACE(static_cast<int>(model));
    const auto preparation = Prepare();
    DeformerOptions options;
    options.model = model;
    // Its second factor goes with the harmonic fields.
    options.gradient_field.guidance = Guidance::kUniform;
    reported_.clear();
    ASSERT_THAT(CreateDeformer(preparation, options), IsOk());
    std::vector<PreparationStage> stages;
    int64_t step = 0;
    for (const PreparationProgress& progress : reported_) {
      if (stages.empty() || stages.back() != progress.stage) stages.push_back(progress.stage);
      EXPECT_GE(progress.step, step);
      EXPECT_LE(progress.step, progress.steps);
      step = progress.step;
    }
    EXPECT_THAT(stages, ::testing::ElementsAre(
                            PreparationStage::kAssembling, PreparationStage::kOrdering,
                            PreparationStage::kFactorising, PreparationStage::kResponses));
    EXPECT_EQ(step, preparation->has_elastic() ? ElasticSystem::kColumnsPerHandle : 0);
    reported_.clear();
    ASSERT_THAT(CreateDeformer(preparation, options), IsOk());
    EXPECT_TRUE(reported_.empty()) << "it is there";
  }
}

TEST_F(MeshPreparationTest, EveryModelCanBeCancelledBeforeItsFactor) {
  for (const DeformationModel model :
       {DeformationModel::kGradientField, DeformationModel::kArap, DeformationModel::kLinearElastic,
        DeformationModel::kNeoHookean}) {
    const auto preparation = Prepare();
    DeformerOptions options;
    options.model = model;
    EXPECT_THAT(CreateDeformer(preparation, options, Cancellation([] { return true; })),
                StatusIs(absl::StatusCode::kCancelled, HasSubstr("canceled")));
    EXPECT_FALSE(preparation->has_laplacian() || preparation->has_elastic());
  }
}

TEST_F(MeshPreparationTest, UnusableInputIsRefused) {
  const ConstraintSet constraints = testing::StackedHandles(mesh_, 1);
  const Eigen::VectorXd stiffness = testing::MixedStiffness(mesh_.num_tets());
  using ::tissueform::testing::kInvalid;
  for (const double ratio : {-0.1, 0.5, std::nan("")}) {
    PreparationOptions options;
    options.poisson_ratio = ratio;
    EXPECT_THAT(MeshPreparation::Create(mesh_, stiffness, constraints, options),
                StatusIs(kInvalid, HasSubstr("Poisson")));
  }
  EXPECT_THAT(MeshPreparation::Create(mesh_, stiffness.head(3), constraints, {}),
              StatusIs(kInvalid, HasSubstr("stiffness has 3 values")));
}

}  // namespace
}  // namespace tissueform
