// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/cotangent_weights.h"

#include "gtest/gtest.h"

#include "core/mesh/operators/laplacian.h"
#include "tests/testing/meshes.h"

namespace tissueform {
namespace {

// The signs that the assembled operator has.
CotangentWeightSigns SignsOfLaplacian(const TetMesh& mesh) {
  const SparseMatrix L = CotangentLaplacian(mesh, Eigen::VectorXd::Ones(mesh.num_tets()));
  CotangentWeightSigns signs;
  for (int column = 0; column < L.outerSize(); ++column) {
    for (SparseMatrix::InnerIterator entry(L, column); entry; ++entry) {
      if (entry.row() <= column) continue;
      ++signs.num_edges;
      signs.num_negative += entry.value() > 1e-9 ? 1 : 0;
    }
  }
  return signs;
}

TEST(CotangentWeightsTest, SignsAreThoseOfTheLaplacian) {
  for (const TetMesh& mesh :
       {testing::Bar({3, 3, 4}, 1.0, 0.3),
        testing::LoadTestMesh("meshes/tet_sofa_tongue/volumetricTongue.vtu")}) {
    const CotangentWeightSigns signs = CountNegativeCotangentWeights(mesh);
    const CotangentWeightSigns expected = SignsOfLaplacian(mesh);
    EXPECT_EQ(signs.num_edges, expected.num_edges);
    EXPECT_EQ(signs.num_negative, expected.num_negative);
    EXPECT_GT(signs.num_negative, 0);
  }
}

TEST(CotangentWeightsTest, RightAnglesAreNotNegative) {
  EXPECT_EQ(CountNegativeCotangentWeights(testing::Bar({3, 3, 3})).num_negative, 0);
}

TEST(CotangentWeightsTest, RegularLikeTetHasSixPositiveWeights) {
  const CotangentWeightSigns signs = CountNegativeCotangentWeights(testing::SingleTet());
  EXPECT_EQ(signs.num_edges, 6);
  EXPECT_EQ(signs.num_negative, 0);
}

TEST(CotangentWeightsTest, ObtuseDihedralAngleMakesItsOppositeEdgeNegative) {
  Positions positions(4, 3);  // a flat tet: the angle at edge 0-1 is obtuse
  positions << 0, 0, 0, 0, 0, 1, 1, 0.1, 0.5, -1, 0.1, 0.5;
  TetIndices tets(1, 4);
  tets << 0, 1, 2, 3;
  const TetMesh mesh = *TetMesh::Create(positions, tets);
  EXPECT_GE(CountNegativeCotangentWeights(mesh).num_negative, 1);
  EXPECT_EQ(CountNegativeCotangentWeights(mesh).num_negative, SignsOfLaplacian(mesh).num_negative);
}

}  // namespace
}  // namespace tissueform
