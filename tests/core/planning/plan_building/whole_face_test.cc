// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// The face that the CT shows is in the mesh, and where it is not, no measure says that it is: on
// the bundled head, and on the same head with a nose of thin walls, or one that the scanner's
// circle cuts.

#include <array>
#include <cmath>
#include <random>
#include <utility>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/status_macros.h"
#include "core/imaging/anatomy/bone_parts.h"
#include "core/imaging/anatomy/osteotomy.h"
#include "core/imaging/anatomy/outer_skin.h"
#include "core/imaging/anatomy/skin_regions.h"
#include "core/imaging/ct/ct_volume_reader.h"
#include "core/imaging/ct/isotropic_resample.h"
#include "core/imaging/ct/unscanned.h"
#include "core/mesh/tet_topology.h"
#include "core/planning/plan_building/planning_regions.h"
#include "core/planning/plan_building/skin_coverage.h"
#include "core/planning/plan_building/soft_tissue_mesh.h"
#include "core/planning/plan_report/coverage_report.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;
using testing::TestDataPath;

constexpr double kBundledVoxelMm = 3.2;

// What building a plan finds before it cuts bone, and the mesh that it makes.
struct Face {
  HeadSegmentation head;
  Landmarks landmarks;
  SoftTissue tissue;
  SoftTissueMesh mesh;
  PlanningRegions regions;

  absl::StatusOr<SkinCoverage> Coverage(const TriangleMesh& surface,
                                        const PlanningRegions& of_surface,
                                        double ct_voxel_mm) const {
    return MeasureSkinCoverage(
        head, landmarks, {surface, of_surface, tissue.region, &tissue.outside_air}, ct_voxel_mm);
  }
};

absl::StatusOr<CtVolume> BundledVolume() {
  CtReadOptions options;
  options.hu_offset = -1024;
  options.axes = "RPI";
  return ReadCtVolume(TestDataPath("ct/headsq/headsq_quarter.nhdr"), options);
}

absl::StatusOr<HuGrid> BundledCt(double spacing_mm) {
  TF_ASSIGN_OR_RETURN(const CtVolume volume, BundledVolume());
  return ResampleIsotropic(volume, spacing_mm, {.threads = 2});
}

absl::StatusOr<Face> FaceOf(const HuGrid& ct, const LabelGrid& unscanned = {}) {
  TF_ASSIGN_OR_RETURN(HeadSegmentation head, SegmentHead(ct, {}, nullptr, {}, unscanned));
  TF_ASSIGN_OR_RETURN(const BoneParts parts, SeparateBoneParts(head));
  TF_ASSIGN_OR_RETURN(const Landmarks landmarks, FindLandmarks(head, parts));
  const OsteotomySegment cut = DefaultSegment(OsteotomyKind::kBssro, "mandible", landmarks);
  TF_ASSIGN_OR_RETURN(const LabelGrid bone, CutSegments(parts.labels, {cut}));
  TF_ASSIGN_OR_RETURN(
      SoftTissue tissue,
      ExtractSoftTissue(head, bone, landmarks, DefaultRegion(landmarks, bone.geometry)));
  SoftTissueMeshOptions options;
  options.edge_mm = 3.5;
  for (const Vector3d& centre :
       {landmarks.upper_lip, landmarks.lower_lip, landmarks.skin_pogonion}) {
    options.fine_regions.push_back({.centre_mm = centre, .radius_mm = 24, .edge_mm = 2.5});
  }
  TF_ASSIGN_OR_RETURN(SoftTissueMesh mesh, MeshSoftTissue(tissue.field, options));
  const auto tissue_above_hu = static_cast<double>(head.options.tissue_above_hu);
  TF_ASSIGN_OR_RETURN(
      PlanningRegions regions,
      AssignRegions(mesh.mesh, mesh.surface.num_vertices(), tissue, {"mandible"}, {.contact_mm = 3},
                    landmarks, {head.hu, tissue_above_hu, &head.cut}));
  return Face{.head = std::move(head),
              .landmarks = landmarks,
              .tissue = std::move(tissue),
              .mesh = std::move(mesh),
              .regions = std::move(regions)};
}

// All but what is deeper than `wall_mm` behind the skin of the nose's lower part is air.
void HollowNose(double wall_mm, HuGrid* ct) {
  const HeadSegmentation head = SegmentHead(*ct).value();
  const BoneParts parts = SeparateBoneParts(head).value();
  const Landmarks l = FindLandmarks(head, parts).value();
  LabelGrid tissue = MaskWhere(*ct, [&](int16_t hu) { return hu > -500; });
  const LabelGrid outside = MaskWhere(
      DistanceWithin(MaskWhere(tissue, [](uint8_t v) { return v == 0; }),
                     AirReachedByBall(MaskWhere(tissue, [](uint8_t v) { return v == 0; }), 6), 4),
      [](float mm) { return std::isfinite(mm); });
  const FloatGrid depth = DistanceMm(outside);
  const double deeper_than_mm = wall_mm + ct->geometry.spacing_mm / 2;
  ForEachVoxel(tissue, [&](size_t index, const Vector3d& p) {
    const Vector3d from_tip = p - l.nose_tip;
    const bool in_nose = std::abs(from_tip.x()) < 17 && p.z() > l.subnasale.z() &&
                         from_tip.z() < 14 && p.y() < l.subnasale.y() + 12;
    if (in_nose && depth.values[index] > deeper_than_mm) ct->values[index] = -1000;
  });
}

// A scanner's circle, in the slices up to a height: over the bridge of the nose they may be of
// another scan.
struct Circle {
  Vector3d middle;
  double radius_mm;
  double up_to_z_mm;

  // Positive inside.
  double DepthMm(const Vector3d& p) const {
    return radius_mm - std::hypot(p.x() - middle.x(), p.y() - middle.y());
  }
};

void FillOutside(const Circle& circle, CtVolume* volume) {
  size_t voxel = 0;
  for (int k = 0; k < volume->size[2]; ++k) {
    for (int j = 0; j < volume->size[1]; ++j) {
      for (int i = 0; i < volume->size[0]; ++i, ++voxel) {
        const Vector3d place = volume->Place(i, j, k);
        if (place.z() <= circle.up_to_z_mm && circle.DepthMm(place) < 0) volume->hu[voxel] = -1024;
      }
    }
  }
}

// Of the front of the circle, what lies in tissue that stays in the region of interest.
double CutAreaMm2(const Circle& circle, const HuGrid& uncut, const RegionOfInterest& region) {
  constexpr double kStepMm = 0.5;
  constexpr int kStepsToSide = 120;
  const double low_mm = region.below.point_mm.z();
  const auto steps_up = static_cast<int>((circle.up_to_z_mm - low_mm) / kStepMm);
  double area_mm2 = 0;
  for (int across = -kStepsToSide; across < kStepsToSide; ++across) {
    const double angle = kStepMm * across / circle.radius_mm;
    for (int up = 0; up < steps_up; ++up) {
      const Vector3d place(circle.middle.x() + circle.radius_mm * std::sin(angle),
                           circle.middle.y() - circle.radius_mm * std::cos(angle),
                           low_mm + kStepMm * up);
      if (Interpolate(uncut, place) > -500) area_mm2 += kStepMm * kStepMm;
    }
  }
  return area_mm2;
}

bool IsReady(const SkinCoverage& coverage) { return AllPassed(CheckCoverage(coverage)); }

// How far the foremost place of the nose lies before the CT's landmark of it, along the front.
double NoseTipErrorMm(const Face& face) {
  const Vector3d front = face.landmarks.ForwardOf(face.landmarks.upper_teeth);
  double foremost_mm = -1e9;
  for (const auto& row : face.mesh.surface.positions().rowwise()) {
    const Vector3d p = row.transpose();
    if ((p - face.landmarks.nose_tip).norm() < 6) foremost_mm = std::max(foremost_mm, front.dot(p));
  }
  return foremost_mm - front.dot(face.landmarks.nose_tip);
}

class WholeFaceTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    const absl::StatusOr<HuGrid> ct = BundledCt(1.5);
    ASSERT_TRUE(ct.ok()) << ct.status();
    const absl::StatusOr<LabelGrid> unscanned = ResampleUnscanned(*BundledVolume(), 1.5, 2);
    ASSERT_TRUE(unscanned.ok()) << unscanned.status();
    absl::StatusOr<Face> face = FaceOf(*ct, *unscanned);
    ASSERT_TRUE(face.ok()) << face.status();
    shared_face = new Face(*std::move(face));
  }
  static void TearDownTestSuite() {
    delete shared_face;
    shared_face = nullptr;
  }

  // The boundary of what is left of the mesh without the tets that have a corner in a ball. It has
  // no skin where it had none.
  static absl::StatusOr<SkinCoverage> CoverageWithoutBall(const Vector3d& centre,
                                                          double radius_mm) {
    const TetMesh& whole = shared_face->mesh.mesh;
    TetIndices kept(whole.num_tets(), 4);
    Eigen::Index num_kept = 0;
    for (const auto& tet : whole.tets().rowwise()) {
      bool near = false;
      for (const int32_t v : tet) {
        near = near || (whole.positions().row(v).transpose() - centre).norm() < radius_mm;
      }
      if (!near) kept.row(num_kept++) = tet;
    }
    kept.conservativeResize(num_kept, 4);
    TF_ASSIGN_OR_RETURN(const TetMesh rest, TetMesh::Create(whole.positions(), kept));
    TF_ASSIGN_OR_RETURN(const TriangleMesh surface,
                        TriangleMesh::Create(whole.positions(), BoundaryFacets(rest)));
    return shared_face->Coverage(surface, shared_face->regions, kBundledVoxelMm);
  }

  static Face* shared_face;
};

Face* WholeFaceTest::shared_face = nullptr;

TEST_F(WholeFaceTest, TheBundledHeadIsReadyAndItsNoseWhole) {
  ASSERT_OK_AND_ASSIGN(
      const SkinCoverage coverage,
      shared_face->Coverage(shared_face->mesh.surface, shared_face->regions, kBundledVoxelMm));
  EXPECT_TRUE(IsReady(coverage)) << FailedText(CheckCoverage(coverage));
  // Its ears reach the CT's sides, and its face nothing.
  EXPECT_FALSE(coverage.cuts.empty());
  for (const ScannerCut& cut : coverage.cuts) {
    EXPECT_GT(std::abs(cut.middle.x() - shared_face->landmarks.nose_tip.x()), 85);
    EXPECT_EQ(cut.low.x(), cut.high.x());
  }
  for (const std::string& caution : CutCautions(coverage)) {
    EXPECT_THAT(caution, ::testing::Not(::testing::HasSubstr("front of the face")));
  }
  EXPECT_FALSE(NoseIsCut(coverage));
  EXPECT_NEAR(NoseTipErrorMm(*shared_face), 0, 0.5);
  EXPECT_LT(coverage.mesh_skin_on_bone_mm2, 0.01 * coverage.mesh_skin_mm2);
}

// Places of the face, by chance: of the named regions of the mesh's skin; the nose's tip and wings,
// the lips and the chin are among them.
TEST_F(WholeFaceTest, NoPlanPassesWithoutAPieceOf10MmOrMore) {
  std::vector<Vector3d> places = {shared_face->landmarks.nose_tip, shared_face->landmarks.upper_lip,
                                  shared_face->landmarks.lower_lip,
                                  shared_face->landmarks.skin_pogonion,
                                  shared_face->landmarks.mouth_corner.left};
  std::vector<Eigen::Index> named;
  const std::vector<SkinRegion> names =
      NameSkinRegions(shared_face->mesh.surface.positions(), shared_face->landmarks);
  const LabelGrid outside = OutsideAir(shared_face->head);
  const FloatGrid to_outside = DistanceMm(outside);
  for (size_t v = 0; v < names.size(); ++v) {
    const Vector3d p = shared_face->mesh.surface.positions().row(static_cast<Eigen::Index>(v));
    if (names[v] != SkinRegion::kNone && Interpolate(to_outside, p) < 1.5) {
      named.push_back(static_cast<Eigen::Index>(v));
    }
  }
  ASSERT_GT(named.size(), 1000U);
  std::mt19937 random(20261122);  // NOLINT: the same pieces every time
  for (int i = 0; i < 25; ++i) {
    places.push_back(shared_face->mesh.surface.positions().row(
        named[std::uniform_int_distribution<size_t>(0, named.size() - 1)(random)]));
  }
  std::uniform_real_distribution<double> radius_mm(5, 9);
  for (size_t i = 0; i < places.size(); ++i) {
    const double radius = i % 3 == 0 ? 5 : radius_mm(random);
    ASSERT_OK_AND_ASSIGN(const SkinCoverage coverage, CoverageWithoutBall(places[i], radius));
    EXPECT_FALSE(IsReady(coverage))
        << "piece of " << 2 * radius << " mm at " << places[i].transpose();
    EXPECT_GT(coverage.whole.largest_mm, 3) << places[i].transpose();
  }
}

// The walls of a nose are thin, and what is thin was taken away: nose, wings and all.
TEST(ThinNoseTest, ANoseWithWallsOf2MmIsMeshedWhole) {
  ASSERT_OK_AND_ASSIGN(HuGrid ct, BundledCt(1));
  HollowNose(2, &ct);
  CtVolume volume;
  volume.size = ct.geometry.size;
  volume.spacing_mm = Vector3d::Ones();
  volume.origin_mm = ct.geometry.origin_mm;
  volume.hu = ct.values;
  ASSERT_OK_AND_ASSIGN(const HuGrid resampled, ResampleIsotropic(volume, 1.5, {.threads = 2}));
  ASSERT_OK_AND_ASSIGN(const Face face, FaceOf(resampled));
  ASSERT_OK_AND_ASSIGN(const SkinCoverage coverage,
                       face.Coverage(face.mesh.surface, face.regions, 1));
  EXPECT_EQ(coverage.tolerance_mm, 1.5);
  for (const CoveredPart& part : coverage.regions) EXPECT_GE(part.share(), 0.99);
  EXPECT_GT(coverage.regions[static_cast<size_t>(SkinRegion::kNose)].area_mm2, 1200);
  EXPECT_TRUE(IsReady(coverage)) << FailedText(CheckCoverage(coverage));
  EXPECT_NEAR(NoseTipErrorMm(face), 0, 0.5);
  // The hollow is there: of the nose's tissue much was made.
  EXPECT_GT(face.tissue.filled_mm3, 1000);
}

// The cut is neither skin, on either side, nor passed over in silence; the rest is judged as ever.
TEST_F(WholeFaceTest, ReportsANoseWithoutSkinWhereTheScannersCircleCutsIt) {
  constexpr double kSpacingMm = 1.5;
  const Vector3d tip = shared_face->landmarks.nose_tip;
  const Circle circle{
      .middle = tip + Vector3d(0, 126, 0), .radius_mm = 120, .up_to_z_mm = tip.z() + 20};
  ASSERT_OK_AND_ASSIGN(CtVolume volume, BundledVolume());
  ASSERT_OK_AND_ASSIGN(const HuGrid uncut, ResampleIsotropic(volume, kSpacingMm, {.threads = 2}));
  FillOutside(circle, &volume);
  ASSERT_OK_AND_ASSIGN(const HuGrid ct, ResampleIsotropic(volume, kSpacingMm, {.threads = 2}));
  ASSERT_OK_AND_ASSIGN(const LabelGrid unscanned, ResampleUnscanned(volume, kSpacingMm, 2));
  ASSERT_OK_AND_ASSIGN(Face face, FaceOf(ct, unscanned));
  ASSERT_OK_AND_ASSIGN(const SkinCoverage coverage,
                       face.Coverage(face.mesh.surface, face.regions, kBundledVoxelMm));

  double cut_mm2 = 0;  // the ears are cut by the CT's sides
  for (const ScannerCut& cut : coverage.cuts) {
    if (std::abs(cut.middle.x() - tip.x()) < 85) cut_mm2 += cut.area_mm2;
  }
  const double expected_mm2 = CutAreaMm2(circle, uncut, face.tissue.region);
  EXPECT_GT(expected_mm2, 100);
  EXPECT_NEAR(cut_mm2, expected_mm2, 0.2 * expected_mm2);
  EXPECT_NEAR(coverage.cuts[0].middle.x(), tip.x(), 4);
  EXPECT_NEAR(coverage.cuts[0].middle.y(), tip.y() + 6, 4);
  EXPECT_LE(coverage.cuts[0].low.z(), tip.z());
  EXPECT_GE(coverage.cuts[0].high.z(), tip.z());
  EXPECT_TRUE(NoseIsCut(coverage));
  ASSERT_FALSE(CutCautions(coverage).empty());
  EXPECT_THAT(CutCautions(coverage)[0], ::testing::HasSubstr("The field of view"));
  EXPECT_THAT(CutCautions(coverage)[0], ::testing::HasSubstr("the nose ("));
  EXPECT_TRUE(IsReady(coverage)) << FailedText(CheckCoverage(coverage));

  // What the whole head has as tissue, on the circle: of the CT's skin, and of the mesh's.
  const auto is_cut = [&](const Vector3d& p) {
    return p.z() < circle.up_to_z_mm && std::abs(circle.DepthMm(p)) < 2.5 &&
           Interpolate(uncut, p) > 0;
  };
  const auto skin_at_cut = [&](const SkinCoverage& measured) {
    int64_t count = 0;
    for (const auto& triangle : measured.triangles.rowwise()) {
      const Vector3d middle =
          (measured.positions.row(triangle[0]) + measured.positions.row(triangle[1]) +
           measured.positions.row(triangle[2])) /
          3;
      if (is_cut(middle)) ++count;
    }
    return count;
  };
  EXPECT_EQ(skin_at_cut(coverage), 0);
  int64_t at_cut = 0;
  for (Eigen::Index v = 0; v < face.mesh.surface.num_vertices(); ++v) {
    if (!is_cut(face.mesh.surface.positions().row(v))) continue;
    ++at_cut;
    EXPECT_FALSE(face.regions.on_skin[static_cast<size_t>(v)]);
    EXPECT_EQ(face.regions.skin_region[static_cast<size_t>(v)], 0);
    if (face.regions.bone[static_cast<size_t>(v)] != 0) continue;
    EXPECT_EQ(face.regions.anatomy[static_cast<size_t>(v)], 0) << "held at the cut";
  }
  EXPECT_GT(at_cut, 10);

  // Without the circle, it takes the cut for skin.
  face.head.cut = {};
  ASSERT_OK_AND_ASSIGN(const SkinCoverage without_circle,
                       face.Coverage(face.mesh.surface, face.regions, kBundledVoxelMm));
  EXPECT_TRUE(without_circle.cuts.empty());
  EXPECT_GT(skin_at_cut(without_circle), 50);
}

}  // namespace
}  // namespace tissueform
