// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/segment_move.h"

#include <cmath>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include <Eigen/Geometry>

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::IsOk;

std::string Itk(const std::string& kind, const std::string& parameters, const std::string& fixed) {
  return absl::StrCat("#Insight Transform File V1.0\n#Transform 0\nTransform: ", kind,
                      "_double_3_3\nParameters: ", parameters, "\nFixedParameters: ", fixed, "\n");
}

// A bumpy egg: no rotation takes it to itself.
TriangleMesh Egg(int rows) {
  std::vector<Eigen::RowVector3d> points;
  std::vector<Eigen::RowVector3i> faces;
  const int columns = 2 * rows;
  for (int i = 0; i <= rows; ++i) {
    for (int j = 0; j < columns; ++j) {
      const double t = M_PI * (0.02 + 0.96 * i / rows);
      const double p = 2 * M_PI * j / columns;
      const double r = 1 + 0.15 * std::cos(3 * p + 1) * std::sin(t) + 0.1 * std::cos(2 * t + p);
      points.emplace_back(30 * r * std::sin(t) * std::cos(p), 20 * r * std::sin(t) * std::sin(p),
                          15 * r * std::cos(t));
      if (i == rows) continue;
      const int a = i * columns + j;
      const int b = i * columns + (j + 1) % columns;
      faces.emplace_back(a, a + columns, b);
      faces.emplace_back(b, a + columns, b + columns);
    }
  }
  Positions positions(static_cast<Eigen::Index>(points.size()), 3);
  for (size_t v = 0; v < points.size(); ++v)
    positions.row(static_cast<Eigen::Index>(v)) = points[v];
  TriangleIndices triangles(static_cast<Eigen::Index>(faces.size()), 3);
  for (size_t f = 0; f < faces.size(); ++f) triangles.row(static_cast<Eigen::Index>(f)) = faces[f];
  return *TriangleMesh::Create(std::move(positions), std::move(triangles));
}

RigidMove AMove() {
  const Eigen::Vector3d axis(0.3, -0.8, 0.5);
  return {Eigen::AngleAxisd(0.12, axis.normalized()).toRotationMatrix(), {1, -6, 2}};
}

TriangleMesh MovedMesh(const TriangleMesh& mesh, const RigidMove& move) {
  return *TriangleMesh::Create(Moved(mesh.positions(), move), mesh.triangles());
}

void ExpectEqual(const RigidMove& a, const RigidMove& b, double tolerance) {
  EXPECT_LT((a.rotation - b.rotation).cwiseAbs().maxCoeff(), tolerance / 20);
  EXPECT_LT((a.translation_mm - b.translation_mm).norm(), tolerance);
}

TEST(SegmentMoveTest, TranslationFileMovesTheOtherWay) {
  const auto move = ParseItkTransform(Itk("TranslationTransform", "0 6 0", ""));
  ASSERT_THAT(move.status(), IsOk());
  ExpectEqual(*move, {Eigen::Matrix3d::Identity(), {0, -6, 0}}, 1e-12);
  EXPECT_THAT(MoveText(PoseOf(*move, {5, 5, 5})), HasSubstr("moves 6.0 mm forward"));
}

TEST(SegmentMoveTest, KindsOfOneRotationAboutACenterAgree) {
  // 0.2 rad about z, center (10, 20, 30), shift (1, 2, 3): y = R (x - c) + c + t.
  const double c = std::cos(0.2);
  const double s = std::sin(0.2);
  const std::vector<std::string> texts = {
      Itk("AffineTransform", absl::StrCat(c, " ", -s, " 0 ", s, " ", c, " 0 0 0 1 1 2 3"),
          "10 20 30"),
      Itk("Euler3DTransform", "0 0 0.2 1 2 3", "10 20 30 0"),
      Itk("Euler3DTransform", "0 0 0.2 1 2 3", "10 20 30 1"),
      Itk("VersorRigid3DTransform", absl::StrCat("0 0 ", std::sin(0.1), " 1 2 3"), "10 20 30")};
  for (const std::string& text : texts) {
    const auto move = ParseItkTransform(text);
    ASSERT_THAT(move.status(), IsOk()) << text;
    const Eigen::Vector3d x(7, -3, 4);
    const Eigen::Vector3d center(10, 20, 30);
    const Eigen::Vector3d y = Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitZ()) * (x - center) +
                              center + Eigen::Vector3d(1, 2, 3);
    EXPECT_LT((move->rotation * y + move->translation_mm - x).norm(), 1e-4) << text;
  }
}

TEST(SegmentMoveTest, EulerAnglesTurnInTheOrderZxyUnlessTheFileSaysZyx) {
  const auto zxy = ParseItkTransform(Itk("Euler3DTransform", "0.3 0.2 0.1 0 0 0", "0 0 0"));
  const auto zyx = ParseItkTransform(Itk("Euler3DTransform", "0.3 0.2 0.1 0 0 0", "0 0 0 1"));
  ASSERT_THAT(zxy.status(), IsOk());
  ASSERT_THAT(zyx.status(), IsOk());
  const Eigen::AngleAxisd x(0.3, Eigen::Vector3d::UnitX());
  const Eigen::AngleAxisd y(0.2, Eigen::Vector3d::UnitY());
  const Eigen::AngleAxisd z(0.1, Eigen::Vector3d::UnitZ());
  EXPECT_LT((zxy->rotation.transpose() - (z * x * y).toRotationMatrix()).norm(), 1e-12);
  EXPECT_LT((zyx->rotation.transpose() - (z * y * x).toRotationMatrix()).norm(), 1e-12);
}

TEST(SegmentMoveTest, RefusesNonRigidTransformsWithTheReason) {
  const auto said = [](const std::string& text) {
    const auto move = ParseItkTransform(text);
    EXPECT_FALSE(move.ok());
    return std::string(move.status().message());
  };
  EXPECT_THAT(said(Itk("AffineTransform", "2 0 0 0 2 0 0 0 2 0 0 0", "0 0 0")),
              HasSubstr("scales or shears"));
  EXPECT_THAT(said(Itk("AffineTransform", "1 0.1 0 0 1 0 0 0 1 0 0 0", "0 0 0")),
              HasSubstr("scales or shears"));
  EXPECT_THAT(said(Itk("AffineTransform", "-1 0 0 0 1 0 0 0 1 0 0 0", "0 0 0")),
              HasSubstr("mirrors"));
  EXPECT_THAT(said(Itk("BSplineTransform", "1 2 3", "")), HasSubstr("not rigid"));
  EXPECT_THAT(said(Itk("AffineTransform", "1 0 0", "")), HasSubstr("wrong number"));
  EXPECT_THAT(said(Itk("TranslationTransform", "1 nan 0", "")), HasSubstr("not a number"));
  EXPECT_THAT(said(Itk("TranslationTransform", "1 0 0", "") +
                   "Transform: TranslationTransform_double_3_3\n"),
              HasSubstr("several"));
  EXPECT_THAT(said("solid jaw"), HasSubstr("does not begin with"));
}

TEST(SegmentMoveTest, FitBetweenTheSameTrianglesIsExact) {
  const TriangleMesh egg = Egg(20);
  const auto fit = FitRigidly(egg, MovedMesh(egg, AMove()));
  ASSERT_THAT(fit.status(), IsOk());
  ExpectEqual(fit->move, AMove(), 1e-9);
  EXPECT_LT(fit->rms_mm, 1e-9);
}

TEST(SegmentMoveTest, FitBetweenOtherTrianglesOfOnePieceIsClose) {
  const auto fit = FitRigidly(Egg(30), MovedMesh(Egg(37), AMove()));
  ASSERT_THAT(fit.status(), IsOk());
  ExpectEqual(fit->move, AMove(), 0.1);
  EXPECT_LT(fit->rms_mm, 0.1);
}

TEST(SegmentMoveTest, AnotherPieceIsRefused) {
  const TriangleMesh egg = Egg(30);
  const TriangleMesh larger = *TriangleMesh::Create(egg.positions() * 1.5, egg.triangles());
  EXPECT_THAT(std::string(FitRigidly(egg, larger).status().message()),
              HasSubstr("not the same piece"));
}

TEST(SegmentMoveTest, PoseMovesAsTheMoveDoes) {
  const HandlePose pose = PoseOf(AMove(), {4, 5, 6});
  const Eigen::Vector3d x(-20, 7, 9);
  EXPECT_LT((ApplyPose(pose, x) - (AMove().rotation * x + AMove().translation_mm)).norm(), 1e-12);
}

}  // namespace
}  // namespace tissueform
