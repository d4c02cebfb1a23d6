// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/constraints/constraint_set.h"

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::IsOk;
using testing::StatusIs;

using ::tissueform::testing::kInvalid;

TEST(ConstraintSetTest, MergesRegionsInRisingOrderAndDropsRepetitions) {
  const TetMesh bar = testing::Bar({1, 1, 3});
  ASSERT_OK_AND_ASSIGN(
      const ConstraintSet set,
      ConstraintSet::Create(bar, {3, 1, 3}, {{"chin", {15, 14}}, {"jaw", {8, 2, 8}}}));
  EXPECT_THAT(set.fixed(), ElementsAre(1, 3));
  EXPECT_THAT(set.constrained(), ElementsAre(1, 2, 3, 8, 14, 15));
  EXPECT_THAT(set.region_of_constrained(), ElementsAre(-1, 1, -1, 1, 0, 0));
}

TEST(ConstraintSetTest, OverlapNamesBothRegionsAndTheVertex) {
  const TetMesh bar = testing::Bar({1, 1, 1});
  EXPECT_THAT(ConstraintSet::Create(bar, {0, 1}, {{"chin", {1, 2}}}),
              StatusIs(kInvalid, AllOf(HasSubstr("vertex 1"), HasSubstr("fixed region"),
                                       HasSubstr("\"chin\""))));
  EXPECT_THAT(ConstraintSet::Create(bar, {0}, {{"chin", {1, 2}}, {"jaw", {2}}}),
              StatusIs(kInvalid, AllOf(HasSubstr("\"chin\""), HasSubstr("\"jaw\""))));
}

TEST(ConstraintSetTest, VertexOutsideTheMeshIsRefused) {
  const TetMesh bar = testing::Bar({1, 1, 1});
  EXPECT_THAT(ConstraintSet::Create(bar, {8}, {{"chin", {1}}}),
              StatusIs(kInvalid, HasSubstr("vertex 8")));
  EXPECT_THAT(ConstraintSet::Create(bar, {0}, {{"chin", {-1}}}),
              StatusIs(kInvalid, HasSubstr("vertex -1")));
}

TEST(ConstraintSetTest, HandlesNeedNamesThatDifferAndVertices) {
  const TetMesh bar = testing::Bar({1, 1, 1});
  EXPECT_THAT(ConstraintSet::Create(bar, {0}, {}), StatusIs(kInvalid, HasSubstr("no handle")));
  EXPECT_THAT(ConstraintSet::Create(bar, {0}, {{"", {1}}}),
              StatusIs(kInvalid, HasSubstr("empty name")));
  EXPECT_THAT(ConstraintSet::Create(bar, {0}, {{"chin", {}}}),
              StatusIs(kInvalid, HasSubstr("selects no vertex")));
  EXPECT_THAT(ConstraintSet::Create(bar, {0}, {{"chin", {1}}, {"chin", {2}}}),
              StatusIs(kInvalid, HasSubstr("two handles are named")));
}

TEST(CheckEveryComponentConstrainedTest, NamesTheComponentWithoutConstraint) {
  const TetMesh tet = testing::SingleTet();
  Positions positions(9, 3);
  positions << tet.positions(), tet.positions().array() + 10.0, 9, 9, 9;
  TetIndices tets(2, 4);
  tets << 0, 1, 2, 3, 4, 5, 6, 7;
  ASSERT_OK_AND_ASSIGN(const TetMesh mesh, TetMesh::Create(positions, tets));
  ASSERT_OK_AND_ASSIGN(const ConstraintSet one_part,
                       ConstraintSet::Create(mesh, {0}, {{"chin", {1}}}));
  EXPECT_THAT(CheckEveryComponentConstrained(mesh.tets(), 9, one_part),
              StatusIs(kInvalid, AllOf(HasSubstr("component 1 of 2"), HasSubstr("4 vertices"),
                                       HasSubstr("vertex 4"))));
  ASSERT_OK_AND_ASSIGN(const ConstraintSet both_parts,
                       ConstraintSet::Create(mesh, {0}, {{"chin", {5}}}));
  EXPECT_THAT(CheckEveryComponentConstrained(mesh.tets(), 9, both_parts), IsOk());
}

}  // namespace
}  // namespace tissueform
