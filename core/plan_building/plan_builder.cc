// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/plan_building/plan_builder.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_format.h"

#include "core/anatomy/itk_filters.h"
#include "core/anatomy/surface_extraction.h"
#include "core/base/status_macros.h"
#include "core/ct/isotropic_resample.h"
#include "core/plan_building/contact_trial.h"

namespace tissueform {
namespace {

// How large the parts are that have smaller triangles, round the lips and the chin, in mm.
constexpr double kFineRadiusMm = 24;

// Without a number in the recipe: this part of the largest planned move, and no less than so many
// voxels. Both sides keep this distance, so the gap between them is twice as wide.
constexpr double kBandOfMove = 0.5;
constexpr double kBandVoxels = 2;

// A stage of the work and where in it the others begin.
class Progress {
 public:
  explicit Progress(const StageFunction& tell) : tell_(tell) {}

  void Begin(absl::string_view stage, double from, double to) {
    from_ = from;
    to_ = to;
    TellStage(tell_, stage, from);
  }
  // What the parts of a stage are told by.
  StageFunction Parts() const {
    return [this](absl::string_view stage, double fraction) {
      TellStage(tell_, stage, from_ + (to_ - from_) * fraction);
    };
  }

 private:
  const StageFunction& tell_;
  double from_ = 0;
  double to_ = 0;
};

absl::StatusOr<HuGrid> ReadAndResample(const std::string& ct_path, const PlanBuildOptions& options,
                                       Progress* progress, PlanBuild* build) {
  progress->Begin("reading the CT", 0, 0.08);
  TF_ASSIGN_OR_RETURN(const CtVolume volume, ReadCtVolume(ct_path, build->recipe.ct));
  build->ct = volume.provenance;
  build->ct_size = volume.size;
  build->ct_spacing_mm = volume.spacing_mm;
  progress->Begin("resampling", 0.08, 0.12);
  return ResampleIsotropic(volume, build->recipe.spacing_mm, {.threads = options.threads});
}

absl::Status FindAnatomy(const HuGrid& ct, Progress* progress, PlanBuild* build) {
  progress->Begin("finding the head and its bone", 0.12, 0.3);
  TF_ASSIGN_OR_RETURN(build->head, SegmentHead(ct, build->recipe.segmentation, progress->Parts()));
  progress->Begin("telling the bones apart", 0.3, 0.42);
  TF_ASSIGN_OR_RETURN(build->parts, SeparateBoneParts(build->head, build->recipe.occlusal_plane,
                                                      progress->Parts()));
  progress->Begin("finding landmarks", 0.42, 0.46);
  TF_ASSIGN_OR_RETURN(build->landmarks, FindLandmarks(build->head, build->parts));
  return absl::OkStatus();
}

absl::StatusOr<TriangleMesh> SegmentSurface(const LabelGrid& bone, uint8_t label) {
  LabelGrid mask = MaskWhere(bone, [label](uint8_t value) { return value == label; });
  mask = Crop(mask, Grown(BoundingBox(mask), 3, mask.geometry));
  return ExtractSurface(GaussianSmooth(SignedDistanceMm(mask), 0.7 * mask.geometry.spacing_mm));
}

absl::Status CheckMove(const std::string& segment, double largest_move_mm) {
  if (largest_move_mm <= kMostMoveMm) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrFormat("the \"pose\" of segment \"%s\" moves some of its bone by %.1f mm; a plan "
                      "moves bone by at most %g mm (is the pivot where the bone is, in mm, LPS?)",
                      segment, largest_move_mm, kMostMoveMm));
}

absl::Status CutBone(Progress* progress, PlanBuild* build) {
  progress->Begin("cutting the bone", 0.46, 0.5);
  std::vector<OsteotomySegment> cuts;
  for (const RecipeSegment& segment : build->recipe.segments) {
    cuts.push_back(segment.planes.empty()
                       ? DefaultSegment(segment.kind, segment.name, build->landmarks)
                       : OsteotomySegment{segment.name, segment.kind, segment.planes});
  }
  TF_ASSIGN_OR_RETURN(build->bone, CutSegments(build->parts.labels, cuts));
  for (size_t s = 0; s < cuts.size(); ++s) {
    const auto label = static_cast<uint8_t>(kFirstSegment + s);
    const HandlePose& pose = build->recipe.segments[s].pose;
    const double largest_move_mm = LargestMoveMm(build->bone, label, pose);
    TF_RETURN_IF_ERROR(CheckMove(cuts[s].name, largest_move_mm));
    TF_ASSIGN_OR_RETURN(TriangleMesh surface, SegmentSurface(build->bone, label));
    const auto voxels = std::count(build->bone.values.begin(), build->bone.values.end(), label);
    build->segments.push_back(
        {.cut = std::move(cuts[s]),
         .pose = pose,
         .largest_move_mm = largest_move_mm,
         .volume_mm3 = static_cast<double>(voxels) * VoxelVolumeMm3(build->bone.geometry),
         .surface = std::move(surface)});
  }
  return absl::OkStatus();
}

absl::Status FindSoftTissue(Progress* progress, PlanBuild* build) {
  progress->Begin("finding the soft tissue", 0.5, 0.62);
  const Recipe& recipe = build->recipe;
  RegionOfInterest region = DefaultRegion(build->landmarks, build->head.hu.geometry);
  region.back = recipe.back.value_or(region.back);
  region.above = recipe.above.value_or(region.above);
  region.below = recipe.below.value_or(region.below);
  TF_ASSIGN_OR_RETURN(build->soft_tissue,
                      ExtractSoftTissue(build->head, build->bone, build->landmarks, region,
                                        recipe.soft_tissue, progress->Parts()));
  return absl::OkStatus();
}

std::vector<FineRegion> LipsAndChin(const Landmarks& landmarks, double edge_mm) {
  std::vector<FineRegion> regions;
  for (const Eigen::Vector3d& centre :
       {landmarks.upper_lip, landmarks.lower_lip, landmarks.skin_pogonion}) {
    regions.push_back({.centre_mm = centre, .radius_mm = kFineRadiusMm, .edge_mm = edge_mm});
  }
  return regions;
}

absl::Status Mesh(Progress* progress, PlanBuild* build) {
  progress->Begin("meshing", 0.62, 0.9);
  const RecipeMesh& recipe = build->recipe.mesh;
  SoftTissueMeshOptions options;
  options.edge_mm = recipe.edge_mm;
  options.fine_regions = LipsAndChin(build->landmarks, recipe.fine_edge_mm);
  options.interior_edge_factor = recipe.interior_edge_factor;
  options.min_dihedral_deg = recipe.min_dihedral_deg;
  options.min_cavity_volume_mm3 = build->recipe.soft_tissue.smallest_cavity_mm3;
  int stages = 0;
  options.on_stage = [&](absl::string_view stage) {
    progress->Parts()(stage, std::min(0.9, 0.15 * stages++));
    return absl::OkStatus();
  };
  TF_ASSIGN_OR_RETURN(build->mesh, MeshSoftTissue(build->soft_tissue.field, options));
  return absl::OkStatus();
}

double BandMm(const PlanBuild& build) {
  if (build.recipe.contact_band_mm) return *build.recipe.contact_band_mm;
  double largest_move_mm = 0;
  for (const BuiltSegment& segment : build.segments) {
    largest_move_mm = std::max(largest_move_mm, segment.largest_move_mm);
  }
  return std::max(kBandVoxels * build.recipe.spacing_mm, kBandOfMove * largest_move_mm);
}

absl::Status Describe(int threads, Progress* progress, PlanBuild* build) {
  progress->Begin("stiffness and regions", 0.9, 1);
  const TetMesh& mesh = build->mesh->mesh;
  TF_ASSIGN_OR_RETURN(build->stiffness, ComputeTetStiffness(mesh, build->head.hu, build->head.bone,
                                                            {.table = build->recipe.tissues}));
  std::vector<std::string> names;
  for (const BuiltSegment& segment : build->segments) names.push_back(segment.cut.name);
  build->contact_band_mm = BandMm(*build);
  TF_ASSIGN_OR_RETURN(
      build->regions,
      AssignRegions(
          mesh, build->mesh->surface.num_vertices(), build->soft_tissue, names,
          build->contact_band_mm, build->landmarks,
          {build->head.hu, static_cast<double>(build->recipe.segmentation.tissue_above_hu)}));
  std::vector<HandlePose> poses;
  for (const BuiltSegment& segment : build->segments) poses.push_back(segment.pose);
  TF_ASSIGN_OR_RETURN(build->freed_by_trial,
                      ReleaseTornContacts({.mesh = mesh,
                                           .youngs_modulus_pa = build->stiffness.youngs_modulus_pa,
                                           .poisson_ratio = build->recipe.poisson_ratio,
                                           .poses = std::move(poses),
                                           .threads = threads},
                                          &build->regions));
  build->skin_distance =
      MeasureSkinDistance(build->mesh->surface, build->regions.on_skin, build->head.hu,
                          build->recipe.segmentation.tissue_above_hu);
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<PlanBuild> BuildPlan(const std::string& ct_path, const Recipe& recipe,
                                    const PlanBuildOptions& options) {
  PlanBuild build;
  build.recipe = recipe;
  Progress progress(options.tell);
  {
    TF_ASSIGN_OR_RETURN(const HuGrid ct, ReadAndResample(ct_path, options, &progress, &build));
    TF_RETURN_IF_ERROR(FindAnatomy(ct, &progress, &build));
  }
  TF_RETURN_IF_ERROR(CutBone(&progress, &build));
  TF_RETURN_IF_ERROR(FindSoftTissue(&progress, &build));
  TF_RETURN_IF_ERROR(Mesh(&progress, &build));
  TF_RETURN_IF_ERROR(Describe(options.threads, &progress, &build));
  TellStage(options.tell, "done", 1);
  return build;
}

}  // namespace tissueform
