// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/chosen_vertices.h"

#include <algorithm>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mechanics/answer_evaluator/vertex_places.h"
#include "core/mechanics/deformation/create_deformer.h"
#include "core/mechanics/prepared_answers/create_response.h"
#include "tests/testing/handle_problem.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using testing::LargestDistance;
using testing::RandomNumbers;

// Coordinates that single precision rounds.
Positions SevenPlaces() {
  Positions rest(7, 3);
  for (int v = 0; v < 7; ++v) rest.row(v) << 10 + v / 3.0, v / 7.0, -v / 11.0;
  return rest;
}

ConstraintSet OfSeven() { return *ConstraintSet::Create(7, {1, 4}, {{"a", {0, 6}}, {"b", {3}}}); }

// As a response has them.
struct Chosen {
  explicit Chosen(const std::vector<int32_t>& vertices)
      : free(DescribeVertices(SevenPlaces(), OfSeven(), vertices, &answers)), places(answers) {}

  void Complete(const std::vector<HandlePose>& poses, FloatPositions* positions) const {
    places.Complete(answers, ToAnswerPoses(poses), positions->data());
  }
  double RoundingBoundMm(const std::vector<HandlePose>& poses) const {
    return places.ErrorMm(ToAnswerPoses(poses));
  }

  PortableAnswers answers;
  std::vector<int32_t> free;
  VertexPlaces places;
};

TEST(ChosenVerticesTest, FreeOnesGoToTheirPlacesAndAllOthersToTheirs) {
  const Positions rest = SevenPlaces();
  const std::vector<int32_t> vertices = {4, 2, 5, 0, 2, 1, 3, 5};
  const Chosen chosen(vertices);
  EXPECT_EQ(chosen.answers.regions.size(), size_t{8});
  EXPECT_EQ(chosen.places.num_free(), size_t{4});
  EXPECT_THAT(chosen.free, ElementsAre(2, 5, 2, 5));

  FloatPositions positions(8, 3);
  for (int row = 0; row < 4; ++row) positions.row(row).setConstant(static_cast<float>(100 + row));
  std::vector<HandlePose> poses(2);
  poses[0].translation_mm = {1, 2, 3};
  poses[1].rotation_vector = {0, 0, 1};
  poses[1].pivot_mm = {5, 5, 5};
  poses[1].scale = 1.1;
  chosen.Complete(poses, &positions);
  EXPECT_EQ(positions(1, 0), 100);
  EXPECT_EQ(positions(2, 1), 101);
  EXPECT_EQ(positions(4, 2), 102);
  EXPECT_EQ(positions(7, 0), 103);
  EXPECT_EQ(positions.row(0), rest.row(4).cast<float>());
  EXPECT_EQ(positions.row(5), rest.row(1).cast<float>());
  const double bound = chosen.RoundingBoundMm(poses);
  EXPECT_LT(bound, 2e-6);
  for (const auto& [place, vertex, handle] : {std::tuple(3, 0, 0), std::tuple(6, 3, 1)}) {
    const Eigen::Vector3d expected = ApplyPose(poses[handle], rest.row(vertex).transpose());
    EXPECT_LE((positions.row(place).transpose().cast<double>() - expected).norm(), bound);
  }
}

// One rounding to single precision, wherever the handle is.
TEST(ChosenVerticesTest, HandlesAreWithinHalfAUnitInTheLastPlaceOfTheLargestCoordinate) {
  const Positions rest = SevenPlaces();
  const std::vector<int32_t> vertices = {0, 3, 6};
  const Chosen chosen(vertices);
  RandomNumbers random(3);
  FloatPositions positions(3, 3);
  double nearest = 0;
  for (int sample = 0; sample < 1000; ++sample) {
    const auto poses = testing::RandomPoses(2, 3, 0.1, sample, &random);
    chosen.Complete(poses, &positions);
    double error = 0;
    for (const auto& [place, handle] : {std::pair(0, 0), std::pair(1, 1), std::pair(2, 0)}) {
      const Eigen::Vector3d expected =
          ApplyPose(poses[handle], rest.row(vertices[place]).transpose());
      error = std::max(error, (positions.row(place).transpose().cast<double>() - expected).norm());
    }
    ASSERT_LE(error, chosen.RoundingBoundMm(poses));
    nearest = std::max(nearest, error / chosen.RoundingBoundMm(poses));
  }
  EXPECT_GT(nearest, 0.5) << "a bound that is never met says little";
}

TEST(ChosenVerticesTest, NoneOrAllMayBeFree) {
  const Positions rest = SevenPlaces();
  const std::vector<HandlePose> poses(2);
  const Chosen free({2, 5});
  FloatPositions positions = FloatPositions::Constant(2, 3, 7);
  free.Complete(poses, &positions);
  EXPECT_EQ(positions, FloatPositions::Constant(2, 3, 7));
  EXPECT_EQ(free.RoundingBoundMm(poses), 0);

  const Chosen held({6, 1});
  EXPECT_THAT(held.free, IsEmpty());
  held.Complete(poses, &positions);
  EXPECT_EQ(positions.row(0), rest.row(6).cast<float>());
  EXPECT_EQ(positions.row(1), rest.row(1).cast<float>());
}

TetMesh OneTet() {
  Positions positions(4, 3);
  positions << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1;
  TetIndices tets(1, 4);
  tets << 0, 1, 2, 3;
  return *TetMesh::Create(positions, tets);
}

struct Model {
  const char* name;
  DeformationModel model;
};

class HeldAnswersTest : public ::testing::TestWithParam<Model> {
 protected:
  // The prepared answers at `vertices` for turned and moved handles against the direct ones.
  void ExpectExact(const std::shared_ptr<MeshPreparation>& preparation,
                   const std::vector<int32_t>& vertices) {
    ASSERT_OK_AND_ASSIGN(
        const auto response,
        CreateResponse(preparation, vertices, {.model = GetParam().model, .max_estimate_mm = 1e3}));
    DeformerOptions options;
    options.model = GetParam().model;
    ASSERT_OK_AND_ASSIGN(const auto direct, CreateDeformer(preparation, options));
    RandomNumbers random(9);
    auto poses = testing::RandomPoses(preparation->constraints().handles().size(), 0.1, 0,
                                      0.1 * preparation->mesh().BoundingBoxDiagonal(), &random);
    FloatPositions positions;
    const std::optional<double> bound_mm = response->Answer(poses, &positions);
    ASSERT_TRUE(bound_mm.has_value());
    EXPECT_EQ(*bound_mm, response->ErrorBoundMm(poses));
    ASSERT_OK_AND_ASSIGN(const Deformation expected, direct->Deform(poses));
    EXPECT_EQ(response->num_vertices(), static_cast<Eigen::Index>(vertices.size()));
    EXPECT_LE(LargestDistance(positions, expected.positions(vertices, Eigen::all)), *bound_mm);
  }
};

TEST_P(HeldAnswersTest, WithNoFreeVertexHandlesAreExactAndNothingElseIsKept) {
  const auto preparation = testing::PrepareMesh(testing::Bar({4, 4, 8}, 2.0, 0.2), 2);
  ExpectExact(preparation, preparation->constraints().constrained());
  ASSERT_OK_AND_ASSIGN(const auto response,
                       CreateResponse(preparation, preparation->constraints().constrained(),
                                      {.model = GetParam().model}));
  std::vector<HandlePose> poses(2);
  poses[0].translation_mm.x() = 1;
  EXPECT_LT(response->ErrorBoundMm(poses), 3e-6);
  EXPECT_EQ(response->num_terms(), 0);
}

TEST_P(HeldAnswersTest, WithFreeVerticesOnlyAndWithOneTet) {
  const auto preparation = testing::PrepareMesh(testing::Bar({4, 4, 8}, 2.0, 0.2), 2);
  const std::vector<int32_t>& held = preparation->constraints().constrained();
  std::vector<int32_t> free = testing::AllVertices(preparation->mesh());
  std::erase_if(free, [&](int32_t v) { return std::binary_search(held.begin(), held.end(), v); });
  ExpectExact(preparation, free);

  const TetMesh tet = OneTet();
  const Eigen::VectorXd stiffness = Eigen::VectorXd::Constant(1, 1e4);
  ASSERT_OK_AND_ASSIGN(const ConstraintSet one_free,
                       ConstraintSet::Create(tet, {0, 1}, {{"top", {3}}}));
  ASSERT_OK_AND_ASSIGN(const auto of_one, MeshPreparation::Create(tet, stiffness, one_free, {}));
  ExpectExact(of_one, {3, 2, 1, 0});
  ExpectExact(of_one, {3});
}

// Rows of zeros, and of what handles do, are what a response without the partition would hold.
TEST_P(HeldAnswersTest, HeldVerticesTakeNoColumns) {
  const auto preparation = testing::PrepareMesh(testing::Bar({4, 4, 8}, 2.0, 0.2), 3);
  std::vector<int32_t> vertices = testing::AllVertices(preparation->mesh());
  const std::vector<int32_t>& held = preparation->constraints().constrained();
  const ResponseOptions options{.model = GetParam().model, .tolerance_mm = 1e-3};
  ASSERT_OK_AND_ASSIGN(const auto all, CreateResponse(preparation, vertices, options));
  std::erase_if(vertices,
                [&](int32_t v) { return std::binary_search(held.begin(), held.end(), v); });
  ASSERT_OK_AND_ASSIGN(const auto free, CreateResponse(preparation, vertices, options));
  EXPECT_EQ(all->num_terms(), free->num_terms());
  // A place and three coordinates each, and a few numbers a handle.
  EXPECT_LE(all->bytes_held() - free->bytes_held(),
            static_cast<int64_t>(held.size() * 40 + 3 * 200));
}

INSTANTIATE_TEST_SUITE_P(Models, HeldAnswersTest,
                         ::testing::Values(Model{"GradientField", DeformationModel::kGradientField},
                                           Model{"LinearElastic", DeformationModel::kLinearElastic},
                                           Model{"NeoHookean", DeformationModel::kNeoHookean}),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace tissueform
