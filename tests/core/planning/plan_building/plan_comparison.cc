// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/core/planning/plan_building/plan_comparison.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <set>
#include <utility>

#include "absl/strings/str_format.h"
#include <Eigen/Geometry>

#include "core/base/percentiles.h"
#include "core/base/status_macros.h"
#include "core/imaging/anatomy/itk_filters.h"
#include "core/imaging/anatomy/outer_skin.h"
#include "core/imaging/anatomy/skin_shell.h"
#include "core/mesh/generation/surface_distance.h"
#include "core/mesh/skin_region.h"

namespace tissueform::testing {
namespace {

// Round a vertex near the skin: one and a half edges of the mesh, so that the other plan's vertices
// of the same bone are within it.
constexpr double kRoundMm = 5;

// Of two plans of one head that differ by the scanner's noise alone: vertices on bone lie a third
// of a voxel deeper or less deep.
constexpr double kDepthNoiseMm = 0.5;

constexpr double kOnOuterSkinMm = 1;

std::vector<std::pair<std::string, Eigen::Vector3d>> Named(const Landmarks& l) {
  return {{"menton", l.menton},
          {"pogonion", l.pogonion},
          {"lower_incisor", l.lower_incisor},
          {"upper_incisor", l.upper_incisor},
          {"lower_molar.left", l.lower_molar.left},
          {"lower_molar.right", l.lower_molar.right},
          {"upper_molar.left", l.upper_molar.left},
          {"upper_molar.right", l.upper_molar.right},
          {"last_upper_tooth.left", l.last_upper_tooth.left},
          {"last_upper_tooth.right", l.last_upper_tooth.right},
          {"ramus_front.left", l.ramus_front.left},
          {"ramus_front.right", l.ramus_front.right},
          {"gonion.left", l.gonion.left},
          {"gonion.right", l.gonion.right},
          {"condyle.left", l.condyle.left},
          {"condyle.right", l.condyle.right},
          {"nasal_floor", l.nasal_floor},
          {"nose_tip", l.nose_tip},
          {"subnasale", l.subnasale},
          {"upper_lip", l.upper_lip},
          {"lower_lip", l.lower_lip},
          {"skin_pogonion", l.skin_pogonion},
          {"mouth_corner.left", l.mouth_corner.left},
          {"mouth_corner.right", l.mouth_corner.right}};
}

void CompareSegments(const TriangleMesh& plan, const TriangleMesh& truth,
                     PlanDifference* difference) {
  std::vector<double> all;
  for (const auto& [from, to] : {std::pair(&plan, &truth), std::pair(&truth, &plan)}) {
    const Eigen::VectorXd mm = DistancesToSurface(from->positions(), *to);
    all.insert(all.end(), mm.begin(), mm.end());
    Eigen::Index row = 0;
    const double most = mm.maxCoeff(&row);
    if (most > difference->segment.mm) {
      difference->segment = {most, from->positions().row(row).transpose(), ""};
    }
  }
  difference->segment_mean_mm =
      std::accumulate(all.begin(), all.end(), 0.0) / static_cast<double>(all.size());
  difference->segment_p95_mm = Percentile(std::move(all), 95);
}

absl::StatusOr<TriangleMesh> SkinOf(const PlanBuild& build) {
  const TriangleMesh& surface = build.mesh.surface;
  std::vector<Eigen::Index> rows;
  for (Eigen::Index f = 0; f < surface.num_triangles(); ++f) {
    const auto corners = surface.triangles().row(f);
    if (std::all_of(corners.begin(), corners.end(), [&build](int32_t v) {
          return build.regions.on_skin[static_cast<size_t>(v)];
        })) {
      rows.push_back(f);
    }
  }
  return TriangleMesh::Create(surface.positions(), surface.triangles()(rows, Eigen::all));
}

// Vertices on bone, and how deep under the outer skin they lie. Walls of nose and mouth are no
// outer skin: bone lies under them by a millimetre or two in every head.
struct BoneDepths {
  Positions places;
  Eigen::VectorXd mm;
};

BoneDepths DepthsOfBone(const PlanBuild& build, const TriangleMesh& outer_skin) {
  std::vector<Eigen::Index> rows;
  for (Eigen::Index v = 0; v < build.mesh.surface.num_vertices(); ++v) {
    if (build.regions.bone[static_cast<size_t>(v)] != 0) rows.push_back(v);
  }
  BoneDepths bone;
  bone.places = build.mesh.surface.positions()(rows, Eigen::all);
  bone.mm = DistancesToSurface(bone.places, outer_skin);
  return bone;
}

// Teeth that the open mouth shows have no skin over them; the rim of a lip lies beside them.
FloatGrid FromExposedTeeth(const PlanBuild& build) {
  return DistanceMm(ExposedTeeth(build.head, OutsideAir(build.head), build.landmarks));
}

void CompareBoneNearSkin(const BoneDepths& plan, const BoneDepths& truth,
                         const FloatGrid& from_teeth, PlanDifference* difference) {
  difference->nearest_bone.mm = std::numeric_limits<double>::infinity();
  for (Eigen::Index v = 0; v < plan.mm.size(); ++v) {
    if (plan.mm[v] >= kNearSkinMm) continue;
    if (Interpolate(from_teeth, plan.places.row(v).transpose()) < kNearSkinMm) continue;
    const auto round =
        (truth.places.rowwise() - plan.places.row(v)).rowwise().squaredNorm().array() <
        kRoundMm * kRoundMm;
    if ((round && truth.mm.array() < kNearSkinMm + kDepthNoiseMm).any()) continue;
    ++difference->bone_near_skin;
    if (plan.mm[v] < difference->nearest_bone.mm) {
      difference->nearest_bone = {plan.mm[v], plan.places.row(v).transpose(), ""};
    }
  }
}

absl::Status CompareSkin(const PlanBuild& plan, const PlanBuild& truth,
                         PlanDifference* difference) {
  TF_ASSIGN_OR_RETURN(
      const SkinCoverage coverage,
      MeasureSkinCoverage(truth.head, truth.landmarks,
                          {plan.mesh.surface, plan.regions, plan.soft_tissue.region},
                          truth.ct_spacing_mm.maxCoeff()));
  difference->least_covered = coverage.whole.share();
  difference->least_covered_region = "whole";
  for (const SkinRegion region : kNamedSkinRegions) {
    const double share = coverage.regions[static_cast<size_t>(region)].share();
    if (share >= difference->least_covered) continue;
    difference->least_covered = share;
    difference->least_covered_region = std::string(SkinRegionName(region));
  }
  return absl::OkStatus();
}

// Of the nearest triangle's corners, by the parts of the point's foot on it; a foot beside it is
// moved in.
struct Foot {
  double squared_mm = std::numeric_limits<double>::infinity();
  Eigen::RowVector3i corners = Eigen::RowVector3i::Zero();
  Eigen::Vector3d parts = Eigen::Vector3d::Zero();  // without a triangle: nothing moves there
};

// Of the triangles that face `towards`, within 60 degrees: lips that touch face each other, and one
// moves with the jaw.
Foot FootOn(const TriangleMesh& skin, const Eigen::Vector3d& point,
            const Eigen::Vector3d& towards) {
  Foot nearest;
  for (const auto& corners : skin.triangles().rowwise()) {
    const Eigen::Vector3d a = skin.positions().row(corners[0]);
    const Eigen::Vector3d ab = skin.positions().row(corners[1]).transpose() - a;
    const Eigen::Vector3d ac = skin.positions().row(corners[2]).transpose() - a;
    const Eigen::Vector3d normal = ab.cross(ac);
    if (normal.dot(towards) < 0.5 * normal.norm() * towards.norm()) continue;
    const double area = normal.squaredNorm();
    const Eigen::Vector3d ap = point - a;
    Eigen::Vector3d parts(0, ap.cross(ac).dot(normal) / area, ab.cross(ap).dot(normal) / area);
    parts[0] = 1 - parts[1] - parts[2];
    parts = parts.cwiseMax(0);
    parts /= parts.sum();
    const double squared = (ap - parts[1] * ab - parts[2] * ac).squaredNorm();
    if (squared < nearest.squared_mm) nearest = {squared, corners, parts};
  }
  return nearest;
}

// Sums of the normals of the triangles about each vertex.
Positions NormalsOf(const TriangleMesh& surface) {
  Positions normals = Positions::Zero(surface.num_vertices(), 3);
  for (const auto& corners : surface.triangles().rowwise()) {
    const Eigen::RowVector3d a = surface.positions().row(corners[0]);
    const Eigen::RowVector3d ab = surface.positions().row(corners[1]) - a;
    const Eigen::RowVector3d ac = surface.positions().row(corners[2]) - a;
    for (const int32_t corner : corners) normals.row(corner) += ab.cross(ac);
  }
  return normals;
}

absl::StatusOr<Positions> MovementsOf(const PlanBuild& build, DeformationModel model) {
  TF_ASSIGN_OR_RETURN(PlanProblem problem, ToPlanProblem(build));
  problem.deformer.model = model;
  TF_ASSIGN_OR_RETURN(const auto deformer, CreateDeformer(*problem.mesh, problem.stiffness,
                                                          problem.constraints, problem.deformer));
  TF_ASSIGN_OR_RETURN(const Deformation answer, deformer->Deform(problem.poses));
  return Positions(answer.positions - problem.mesh->positions());
}

bool IsLipOrChin(uint8_t region) {
  const auto named = static_cast<SkinRegion>(region);
  return named == SkinRegion::kUpperLip || named == SkinRegion::kLowerLip ||
         named == SkinRegion::kChin;
}

// Only where the truth's outer skin is: what shows of tongue and teeth between open lips counts as
// lips, too, and moves by millimetres more or less as the scanner's noise opens a slit or closes
// it.
absl::Status CompareMovements(const PlanBuild& plan, const PlanBuild& truth, DeformationModel model,
                              const TriangleMesh& outer_skin, PlanDifference* difference) {
  TF_ASSIGN_OR_RETURN(const Positions of_plan, MovementsOf(plan, model));
  TF_ASSIGN_OR_RETURN(const Positions of_truth, MovementsOf(truth, model));
  TF_ASSIGN_OR_RETURN(const TriangleMesh skin, SkinOf(plan));
  TF_ASSIGN_OR_RETURN(const TriangleMesh skin_of_truth, SkinOf(truth));
  const auto corners = skin_of_truth.triangles().reshaped();
  const Positions normals = NormalsOf(skin_of_truth);
  const Eigen::VectorXd from_outside =
      DistancesToSurface(truth.mesh.surface.positions(), outer_skin);
  double sum = 0;
  int64_t count = 0;
  for (const int32_t v : std::set<int32_t>(corners.begin(), corners.end())) {
    if (!IsLipOrChin(truth.regions.skin_region[static_cast<size_t>(v)])) continue;
    if (from_outside[v] > kOnOuterSkinMm) continue;
    const Eigen::Vector3d place = truth.mesh.surface.positions().row(v);
    const Foot foot = FootOn(skin, place, normals.row(v).transpose());
    Eigen::Vector3d there = Eigen::Vector3d::Zero();
    for (int corner = 0; corner < 3; ++corner) {
      there += foot.parts[corner] * of_plan.row(foot.corners[corner]).transpose();
    }
    const double mm = (there - of_truth.row(v).transpose()).norm();
    sum += mm;
    ++count;
    if (mm > difference->movement.mm) difference->movement = {mm, place, ""};
  }
  if (count == 0) return absl::InternalError("the plan without metal has no lips and no chin");
  difference->movement_mean_mm = sum / static_cast<double>(count);
  return absl::OkStatus();
}

std::string PlaceOf(const Eigen::Vector3d& place) {
  return absl::StrFormat("(%.0f, %.0f, %.0f)", place.x(), place.y(), place.z());
}

}  // namespace

Recipe MetalRecipe(bool correct) {
  Recipe recipe;
  recipe.metal.correct = correct;
  RecipeSegment mandible;
  mandible.name = "mandible";
  mandible.pose.translation_mm.y() = -6;
  recipe.segments = {mandible};
  return recipe;
}

WorstAt WorstLandmark(const Landmarks& plan, const Landmarks& truth) {
  const auto found = Named(plan);
  const auto known = Named(truth);
  WorstAt worst;
  for (size_t i = 0; i < found.size(); ++i) {
    const double mm = (found[i].second - known[i].second).norm();
    if (mm > worst.mm) worst = {mm, known[i].second, known[i].first};
  }
  return worst;
}

absl::StatusOr<PlanDifference> ComparePlans(const PlanBuild& plan, const PlanBuild& truth,
                                            DeformationModel model) {
  PlanDifference difference;
  CompareSegments(plan.segments[0].surface, truth.segments[0].surface, &difference);
  difference.landmark = WorstLandmark(plan.landmarks, truth.landmarks);
  TF_ASSIGN_OR_RETURN(const TriangleMesh outer_skin,
                      TriangleMesh::Create(truth.coverage.positions, truth.coverage.triangles));
  CompareBoneNearSkin(DepthsOfBone(plan, outer_skin), DepthsOfBone(truth, outer_skin),
                      FromExposedTeeth(truth), &difference);
  TF_RETURN_IF_ERROR(CompareSkin(plan, truth, &difference));
  TF_RETURN_IF_ERROR(CompareMovements(plan, truth, model, outer_skin, &difference));
  return difference;
}

std::string TableHead() {
  return "| CT | segment: mean, 95 %, worst (mm) | worst landmark (mm) | bone near skin (vertices, "
         "least mm) | covered (least of all regions) | movement: mean, worst (mm) "
         "|\n|---|---|---|---|---|---|\n";
}

std::string TableRow(const std::string& name, const PlanDifference& d) {
  const std::string bone =
      d.bone_near_skin == 0 ? "0"
                            : absl::StrFormat("%d, %.1f at %s", d.bone_near_skin, d.nearest_bone.mm,
                                              PlaceOf(d.nearest_bone.place_mm));
  return absl::StrFormat(
      "| %s | %.2f, %.2f, %.1f at %s | %.1f %s %s | %s | %.1f %% %s | %.2f, %.2f at %s |\n", name,
      d.segment_mean_mm, d.segment_p95_mm, d.segment.mm, PlaceOf(d.segment.place_mm), d.landmark.mm,
      d.landmark.name, PlaceOf(d.landmark.place_mm), bone, 100 * d.least_covered,
      d.least_covered_region, d.movement_mean_mm, d.movement.mm, PlaceOf(d.movement.place_mm));
}

}  // namespace tissueform::testing
