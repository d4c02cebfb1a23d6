// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/plan_builder.h"

#include <algorithm>
#include <future>
#include <optional>
#include <utility>

#include "absl/strings/str_format.h"

#include "core/base/status_macros.h"
#include "core/imaging/anatomy/head_checks.h"
#include "core/imaging/anatomy/itk_filters.h"
#include "core/imaging/anatomy/surface_extraction.h"
#include "core/planning/plan_building/given_pieces.h"
#include "core/planning/plan_building/resampled_ct.h"
#include "core/planning/plan_building/surface_head.h"
#include "core/planning/plan_building/surfaces_file.h"
#include "core/planning/plan_building/trial_solve.h"
#include "core/planning/plan_building/viewer_surfaces.h"

namespace tissueform {
namespace {

// How large the parts are that have smaller triangles, round the lips and the chin, in mm: it
// holds a lip, or the soft chin, whole. There tissue is thin over teeth, and its answer is looked
// at.
constexpr double kFineRadiusMm = 24;

// Without a number in the recipe: this part of the largest planned move, and no less than so many
// voxels. Both sides keep this distance, so the gap between them is twice as wide: as wide as the
// move. Tissue in it is then at worst squeezed or stretched by its own width; what tears all the
// same is found by the contact trial.
constexpr double kBandOfMove = 0.5;
constexpr double kBandVoxels = 2;

// A stage of the work and where in it the others begin.
class Progress {
 public:
  explicit Progress(const StageFunction& on_stage) : on_stage_(on_stage) {}

  void Begin(absl::string_view stage, double from, double to) {
    from_ = from;
    to_ = to;
    ReportStage(on_stage_, stage, from);
  }
  // The function that the parts of a stage report their progress to.
  StageFunction Parts() const {
    return [this](absl::string_view stage, double fraction) {
      ReportStage(on_stage_, stage, from_ + (to_ - from_) * fraction);
    };
  }

 private:
  const StageFunction& on_stage_;
  double from_ = 0;
  double to_ = 0;
};

// What the stages hand on, each made whole by one of them.

struct Anatomy {
  HeadSegmentation head;
  BoneParts parts;
  Landmarks landmarks;
  std::optional<FrankfortLandmarks> frankfort;
  HeadFrame frame;
  LabelGrid known_tissue;  // PlanLabels::tissue
  std::vector<std::string> notes;
};

// What CT and surfaces lead to alike, and from which a plan is built.
struct Source {
  CtProvenance provenance;
  std::vector<std::string> surface_roles;  // PlanBuild::surface_roles
  CtValuesReport values;
  std::array<int, 3> size = {0, 0, 0};
  Eigen::Vector3d spacing_mm = Eigen::Vector3d::Zero();
  MetalReport metal;
  LabelGrid carried_skin;
  HuGrid before_correction;
  Anatomy anatomy;
  std::optional<PlanLabels> labels;
  std::optional<LabelGrid> tissue_class;  // what the stiffness goes by, where it is not HU
  std::optional<LabelGrid> segments;      // where they are not cut: as DividedBone::labels
};

struct DividedBone {
  LabelGrid labels;  // 0 none, 1 stays, 2.. the segments
  std::vector<BuiltSegment> segments;
};

struct Description {
  TetStiffness stiffness;
  double contact_band_mm = 0;
  ContactRelaxation released;
  SkinDistance skin_distance;
};

absl::StatusOr<ResampledCt> ReadAndResample(const std::string& ct_path, const Recipe& recipe,
                                            int threads, Progress* progress) {
  progress->Begin("reading the CT", 0, 0.08);
  return ReadResampledCt(ct_path, recipe, threads, [progress] {
    progress->Begin("reducing metal artifacts, resampling", 0.08, 0.12);
  });
}

absl::StatusOr<Anatomy> WithFrame(HeadSegmentation head, BoneParts parts, Landmarks landmarks,
                                  const Recipe& recipe) {
  std::optional<FrankfortLandmarks> frankfort =
      FindFrankfort(head.hu, head.options.bone_above_hu, landmarks);
  std::vector<std::string> notes;
  TF_RETURN_IF_ERROR(PlaceLandmarks(recipe.landmarks, &landmarks, &frankfort, &notes));
  TF_ASSIGN_OR_RETURN(HeadFrame frame, ChooseHeadFrame({.landmarks = landmarks,
                                                        .frankfort = frankfort,
                                                        .given_midsagittal = recipe.midsagittal,
                                                        .given_horizontal = recipe.horizontal}));
  return Anatomy{.head = std::move(head),
                 .parts = std::move(parts),
                 .landmarks = landmarks,
                 .frankfort = frankfort,
                 .frame = std::move(frame),
                 .known_tissue = {},
                 .notes = std::move(notes)};
}

struct HeadAndBone {
  HeadSegmentation head;
  absl::StatusOr<BoneParts> parts;  // an error where the jaws cannot be separated
};

// `labels` may be empty; gets the comparison with what the image alone shows.
absl::StatusOr<HeadAndBone> SegmentBone(const ResampledCt& ct, const Recipe& recipe,
                                        std::optional<PlanLabels>* labels, Progress* progress) {
  progress->Begin("finding head and bone", 0.12, 0.3);
  TF_ASSIGN_OR_RETURN(
      HeadSegmentation head,
      SegmentHead(ct.ct.hu, recipe.segmentation, progress->Parts(), ct.ct.metal, ct.unscanned));
  progress->Begin("separating bones", 0.3, 0.42);
  absl::StatusOr<BoneParts> parts =
      SeparateBoneParts(head, recipe.occlusal_plane, progress->Parts());
  if (labels->has_value())
    parts = SeparateByLabels(std::move(parts), recipe.tissues, &head, &**labels);
  return HeadAndBone{std::move(head), std::move(parts)};
}

absl::StatusOr<Anatomy> FindAnatomy(const ResampledCt& ct, const Recipe& recipe,
                                    std::optional<PlanLabels>* labels, Progress* progress) {
  TF_ASSIGN_OR_RETURN(HeadAndBone bone, SegmentBone(ct, recipe, labels, progress));
  HeadSegmentation& head = bone.head;
  absl::StatusOr<BoneParts>& parts = bone.parts;
  const bool plane_given = recipe.occlusal_plane.has_value();
  if (!parts.ok()) return ExplainMissingAnatomy(head, plane_given, parts.status());
  progress->Begin("finding landmarks", 0.42, 0.46);
  const absl::StatusOr<Landmarks> landmarks = FindLandmarks(head, *parts);
  const absl::Status found = landmarks.ok() ? CheckLandmarks(*landmarks) : landmarks.status();
  if (!found.ok()) return ExplainMissingAnatomy(head, plane_given, found);
  TF_RETURN_IF_ERROR(CheckOneHead(ct.ct.hu, head, *parts));
  TF_ASSIGN_OR_RETURN(Anatomy anatomy,
                      WithFrame(std::move(head), *std::move(parts), *landmarks, recipe));
  if (labels->has_value()) anatomy.known_tissue = std::move((*labels)->tissue);
  return anatomy;
}

// Surfaces separate the bones: only the landmarks are found.
absl::StatusOr<Anatomy> FindAnatomyOfSurfaces(SurfaceHead made, const Recipe& recipe,
                                              Progress* progress) {
  progress->Begin("finding landmarks", 0.42, 0.46);
  const absl::StatusOr<Landmarks> landmarks = FindLandmarks(made.head, made.parts);
  TF_RETURN_IF_ERROR(landmarks.ok() ? CheckLandmarks(*landmarks) : landmarks.status());
  return WithFrame(std::move(made.head), std::move(made.parts), *landmarks, recipe);
}

absl::StatusOr<TriangleMesh> SurfaceOfSegment(const LabelGrid& bone, uint8_t label) {
  LabelGrid mask = MaskWhere(bone, [label](uint8_t value) { return value == label; });
  mask = Crop(mask, Grown(BoundingBox(mask), 3, mask.geometry));
  return ExtractSurface(GaussianSmooth(SignedDistanceMm(mask), 0.7 * mask.geometry.spacing_mm));
}

absl::Status CheckMove(const std::string& segment, double largest_move_mm) {
  if (largest_move_mm <= kMaxMoveMm) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrFormat(
      "the \"pose\" of segment \"%s\" moves some of its bone by %.1f mm; the limit is "
      "%g mm (is the pivot near the bone, in mm, LPS?)",
      segment, largest_move_mm, kMaxMoveMm));
}

absl::StatusOr<BuiltSegment> BuildSegment(const LabelGrid& bone, uint8_t label,
                                          OsteotomySegment cut, const HandlePose& pose) {
  const double largest_move_mm = LargestMoveMm(bone, label, pose);
  TF_RETURN_IF_ERROR(CheckMove(cut.name, largest_move_mm));
  TF_ASSIGN_OR_RETURN(TriangleMesh surface, SurfaceOfSegment(bone, label));
  const auto voxels = std::count(bone.values.begin(), bone.values.end(), label);
  return BuiltSegment{.cut = std::move(cut),
                      .pose = pose,
                      .largest_move_mm = largest_move_mm,
                      .volume_mm3 = static_cast<double>(voxels) * VoxelVolumeMm3(bone.geometry),
                      .surface = std::move(surface)};
}

std::vector<OsteotomySegment> CutsOf(const std::vector<RecipeSegment>& planned,
                                     const Landmarks& landmarks) {
  std::vector<OsteotomySegment> cuts;
  cuts.reserve(planned.size());
  for (const RecipeSegment& segment : planned) {
    cuts.push_back(segment.planes.empty()
                       ? DefaultSegment(segment.kind, segment.name, landmarks)
                       : OsteotomySegment{segment.name, segment.kind, segment.planes});
  }
  return cuts;
}

// Segments that were given as a whole have no planes.
std::vector<OsteotomySegment> WithoutPlanes(std::vector<OsteotomySegment> cuts) {
  for (OsteotomySegment& cut : cuts) cut.planes.clear();
  return cuts;
}

absl::StatusOr<DividedBone> CutBone(const Anatomy& anatomy, std::optional<LabelGrid> given,
                                    const std::vector<RecipeSegment>& planned, Progress* progress) {
  progress->Begin("cutting the bone", 0.46, 0.5);
  std::vector<OsteotomySegment> cuts = CutsOf(planned, anatomy.landmarks);
  DividedBone divided;
  if (given) {
    divided.labels = *std::move(given);
    cuts = WithoutPlanes(std::move(cuts));
  } else {
    TF_ASSIGN_OR_RETURN(divided.labels, CutSegments(anatomy.parts.labels, cuts));
  }
  for (size_t s = 0; s < cuts.size(); ++s) {
    TF_ASSIGN_OR_RETURN(BuiltSegment segment,
                        BuildSegment(divided.labels, static_cast<uint8_t>(kFirstSegment + s),
                                     std::move(cuts[s]), planned[s].pose));
    divided.segments.push_back(std::move(segment));
  }
  return divided;
}

absl::StatusOr<SoftTissue> FindSoftTissue(const Anatomy& anatomy, const LabelGrid& bone,
                                          const Recipe& recipe, Progress* progress) {
  progress->Begin("finding the soft tissue", 0.5, 0.62);
  RegionOfInterest region = DefaultRegion(anatomy.landmarks, anatomy.head.hu.geometry);
  region.back = recipe.back.value_or(region.back);
  region.above = recipe.above.value_or(region.above);
  region.below = recipe.below.value_or(region.below);
  return ExtractSoftTissue(anatomy.head, bone, anatomy.landmarks, region, recipe.soft_tissue,
                           progress->Parts());
}

std::vector<FineRegion> LipsAndChin(const Landmarks& landmarks, double edge_mm) {
  std::vector<FineRegion> regions;
  for (const Eigen::Vector3d& centre :
       {landmarks.upper_lip, landmarks.lower_lip, landmarks.skin_pogonion}) {
    regions.push_back({.centre_mm = centre, .radius_mm = kFineRadiusMm, .edge_mm = edge_mm});
  }
  return regions;
}

absl::StatusOr<SoftTissueMesh> Mesh(const SoftTissue& soft_tissue, const Landmarks& landmarks,
                                    const Recipe& recipe, int threads, Progress* progress) {
  progress->Begin("meshing", 0.62, 0.9);
  SoftTissueMeshOptions options;
  options.edge_mm = recipe.mesh.edge_mm;
  options.fine_regions = LipsAndChin(landmarks, recipe.mesh.fine_edge_mm);
  options.interior_edge_factor = recipe.mesh.interior_edge_factor;
  options.min_dihedral_deg = recipe.mesh.min_dihedral_deg;
  options.min_cavity_volume_mm3 = recipe.soft_tissue.smallest_cavity_mm3;
  options.threads = threads;
  int stages = 0;
  options.on_stage = [&](absl::string_view stage) {
    progress->Parts()(stage, std::min(0.9, 0.15 * stages++));
    return absl::OkStatus();
  };
  return MeshSoftTissue(soft_tissue.field, options);
}

// The seam on which the lips will part, where the recipe wants it.
absl::StatusOr<std::optional<SeamInMesh>> MakeSeam(const Anatomy& anatomy,
                                                   const absl::StatusOr<MouthLine>& line,
                                                   const Recipe& recipe, SoftTissueMesh* mesh) {
  if (!recipe.lips.part) return std::nullopt;
  if (!line.ok() && recipe.lips.mouth_line_mm.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("the lips cannot be parted: ", line.status().message(),
                     "; give \"lips\": {\"mouth_line_mm\": ...} in the recipe, or leave it out"));
  }
  TF_RETURN_IF_ERROR(line.status());
  TF_ASSIGN_OR_RETURN(LipSeam seam,
                      LipSeam::Create(*line, anatomy.parts.labels, anatomy.landmarks));
  TF_ASSIGN_OR_RETURN(SeamInMesh in_mesh, PutSeamInMesh(std::move(seam), mesh));
  return in_mesh;
}

double BandMm(const Recipe& recipe, const std::vector<BuiltSegment>& segments) {
  if (recipe.contact_band_mm) return *recipe.contact_band_mm;
  double largest_move_mm = 0;
  for (const BuiltSegment& segment : segments) {
    largest_move_mm = std::max(largest_move_mm, segment.largest_move_mm);
  }
  return std::max(kBandVoxels * recipe.spacing_mm, kBandOfMove * largest_move_mm);
}

// Empty where no segment says it.
std::vector<double> DissectedMm(const std::vector<RecipeSegment>& segments) {
  std::vector<double> dissected_mm;
  dissected_mm.reserve(segments.size());
  for (const RecipeSegment& segment : segments) dissected_mm.push_back(segment.dissected_mm);
  const bool is_any = std::any_of(dissected_mm.begin(), dissected_mm.end(),
                                  [](double distance_mm) { return distance_mm > 0; });
  return is_any ? dissected_mm : std::vector<double>();
}

// Gray values identify no tissue: what labels do not name is muscle, as most of a face's depth.
LabelGrid TissueWithoutHu(const Anatomy& anatomy, const StiffnessTable& table) {
  constexpr double kMuscleHu = 50;
  LabelGrid tissue(anatomy.head.hu.geometry, static_cast<uint8_t>(TissueOf(table, kMuscleHu)));
  for (size_t i = 0; i < anatomy.known_tissue.values.size(); ++i) {
    if (anatomy.known_tissue.values[i] == 0) continue;
    tissue.values[i] = static_cast<uint8_t>(anatomy.known_tissue.values[i] - 1);
  }
  return tissue;
}

absl::StatusOr<TetStiffness> Stiffness(const TetMesh& mesh, const Source& source,
                                       const StiffnessTable& table) {
  if (source.values.gray) {
    return StiffnessByClass(mesh, TissueWithoutHu(source.anatomy, table), table);
  }
  if (source.tissue_class) return StiffnessByClass(mesh, *source.tissue_class, table);
  const HeadSegmentation& head = source.anatomy.head;
  return ComputeTetStiffness(mesh, head.hu, head.bone,
                             {.table = table, .known_tissue = &source.anatomy.known_tissue});
}

// What the tets are made of and what holds the vertices.
absl::StatusOr<Description> Describe(const SoftTissueMesh& built, const SoftTissue& soft_tissue,
                                     const Source& source, const MouthLine* mouth,
                                     const std::vector<BuiltSegment>& segments,
                                     const Recipe& recipe, int threads, Progress* progress) {
  progress->Begin("assigning stiffness and regions", 0.9, 0.96);
  const Anatomy& anatomy = source.anatomy;
  const HeadSegmentation& head = anatomy.head;
  TF_ASSIGN_OR_RETURN(TetStiffness stiffness, Stiffness(built.mesh, source, recipe.tissues));
  std::vector<HandlePose> poses;
  poses.reserve(segments.size());
  for (const BuiltSegment& segment : segments) poses.push_back(segment.pose);
  const double contact_band_mm = BandMm(recipe, segments);
  const double tissue_above_hu = head.options.tissue_above_hu;
  TF_ASSIGN_OR_RETURN(
      PlanningRegions regions,
      AssignRegions(built.mesh, built.surface.num_vertices(), soft_tissue, NamesOf(segments),
                    {.contact_mm = contact_band_mm,
                     .dissected_mm = DissectedMm(recipe.segments),
                     .parts = &anatomy.parts.labels},
                    anatomy.landmarks, {head.hu, tissue_above_hu, &head.cut, mouth}));
  TF_ASSIGN_OR_RETURN(ContactRelaxation released,
                      ReleaseTornContacts({.mesh = built.mesh,
                                           .youngs_modulus_pa = stiffness.youngs_modulus_pa,
                                           .poisson_ratio = recipe.poisson_ratio,
                                           .poses = std::move(poses),
                                           .threads = threads},
                                          std::move(regions)));
  SkinDistance skin_distance =
      MeasureSkinDistance(built.surface, released.regions.on_skin, head.hu, tissue_above_hu);
  return Description{.stiffness = std::move(stiffness),
                     .contact_band_mm = contact_band_mm,
                     .released = std::move(released),
                     .skin_distance = std::move(skin_distance)};
}

// Replaces what segments name by files, in `planned` as well.
absl::StatusOr<Source> SourceOfCt(const std::string& path, Recipe* planned, int threads,
                                  Progress* progress) {
  // First: files that cannot be used are refused before the CT takes its time.
  TF_ASSIGN_OR_RETURN(const SegmentFiles files, ReadSegmentFiles(*planned, threads));
  TF_ASSIGN_OR_RETURN(ResampledCt ct, ReadAndResample(path, *planned, threads, progress));
  const Recipe recipe = WithThresholds(*planned, ct.values);
  if (!recipe.labels.file.empty()) progress->Begin("reading the label map", 0.12, 0.12);
  TF_ASSIGN_OR_RETURN(std::optional<PlanLabels> labels,
                      ReadPlanLabels(recipe, ct.frame_uid, threads, &ct.ct.hu));
  // The head has HU of its own, as large as the CT's; the next stages need the room.
  TF_ASSIGN_OR_RETURN(Anatomy anatomy, FindAnatomy(ct, recipe, &labels, progress));
  std::vector<std::string>& notes = ct.provenance.notes;
  notes.insert(notes.end(), anatomy.notes.begin(), anatomy.notes.end());
  TF_ASSIGN_OR_RETURN(std::optional<LabelGrid> pieces,
                      PlacePieces(files, threads, planned, &anatomy.head, &anatomy.parts, &notes));
  ResolveMoves(files, anatomy.landmarks, planned, &notes);
  return Source{.provenance = std::move(ct.provenance),
                .surface_roles = {},
                .values = std::move(ct.values),
                .size = ct.size,
                .spacing_mm = ct.spacing_mm,
                .metal = std::move(ct.ct.report),
                .carried_skin = std::move(ct.ct.carried_skin),
                .before_correction = std::move(ct.ct.before),
                .anatomy = std::move(anatomy),
                .labels = std::move(labels),
                .tissue_class = {},
                .segments = std::move(pieces)};
}

absl::StatusOr<Source> SourceOfSurfaces(SurfacesInput input, int threads, Progress* progress) {
  progress->Begin("filling the surfaces with voxels", 0.12, 0.42);
  TF_ASSIGN_OR_RETURN(
      SurfaceHead made,
      MakeHeadFromSurfaces(input.surfaces, input.recipe.spacing_mm, threads, progress->Parts()));
  std::vector<std::string>& notes = input.provenance.notes;
  notes.insert(notes.end(), made.notes.begin(), made.notes.end());
  std::optional<LabelGrid> segments = std::move(made.segments);
  std::optional<LabelGrid> tissue_class = std::move(made.tissue_class);
  const GridGeometry geometry = made.head.hu.geometry;
  TF_ASSIGN_OR_RETURN(Anatomy anatomy,
                      FindAnatomyOfSurfaces(std::move(made), input.recipe, progress));
  return Source{.provenance = std::move(input.provenance),
                .surface_roles = std::move(input.roles),
                .values = {},
                .size = geometry.size,
                .spacing_mm = Eigen::Vector3d::Constant(geometry.spacing_mm),
                .metal = {},
                .carried_skin = {},
                .before_correction = {},
                .anatomy = std::move(anatomy),
                .labels = {},
                .tissue_class = std::move(tissue_class),
                .segments = std::move(segments)};
}

}  // namespace

std::vector<std::string> NamesOf(const std::vector<BuiltSegment>& segments) {
  std::vector<std::string> names;
  names.reserve(segments.size());
  for (const BuiltSegment& segment : segments) names.push_back(segment.cut.name);
  return names;
}

absl::StatusOr<PlanLabels> CompareWithLabels(const std::string& ct_path, const Recipe& given,
                                             const PlanBuildOptions& options) {
  Progress progress(options.on_stage);
  SetFilterThreads(options.threads);
  TF_ASSIGN_OR_RETURN(ResampledCt ct, ReadAndResample(ct_path, given, options.threads, &progress));
  const Recipe recipe = WithThresholds(given, ct.values);
  TF_ASSIGN_OR_RETURN(std::optional<PlanLabels> labels,
                      ReadPlanLabels(recipe, ct.frame_uid, options.threads, &ct.ct.hu));
  if (!labels) return absl::InvalidArgumentError("no label map is named; use --labels");
  TF_ASSIGN_OR_RETURN(const HeadAndBone bone, SegmentBone(ct, recipe, &labels, &progress));
  TF_RETURN_IF_ERROR(bone.parts.status());
  return *std::move(labels);
}

namespace {

absl::StatusOr<PlanBuild> BuildFromSource(Source source, const Recipe& recipe,
                                          const PlanBuildOptions& options, Progress& progress) {
  Anatomy& anatomy = source.anatomy;
  absl::StatusOr<MouthLine> mouth = ChooseMouthLine(recipe.lips, anatomy.head, anatomy.landmarks);
  TF_ASSIGN_OR_RETURN(DividedBone bone,
                      CutBone(anatomy, std::move(source.segments), recipe.segments, &progress));
  TF_ASSIGN_OR_RETURN(SoftTissue soft_tissue,
                      FindSoftTissue(anatomy, bone.labels, recipe, &progress));
  // Made while one processor is busy with meshing.
  std::future<absl::StatusOr<std::vector<CaseSurface>>> viewer_surfaces = std::async(
      options.threads > 1 ? std::launch::async : std::launch::deferred, MakeViewerSurfaces,
      ViewerSources{.head = anatomy.head,
                    .outside_air = soft_tissue.outside_air,
                    .parts = anatomy.parts.labels,
                    .bone = bone.labels,
                    .landmarks = anatomy.landmarks,
                    .segments = NamesOf(bone.segments),
                    .ct_voxel_mm = source.spacing_mm.maxCoeff()});
  TF_ASSIGN_OR_RETURN(SoftTissueMesh mesh,
                      Mesh(soft_tissue, anatomy.landmarks, recipe, options.threads, &progress));
  TF_ASSIGN_OR_RETURN(const std::optional<SeamInMesh> seam,
                      MakeSeam(anatomy, mouth, recipe, &mesh));
  TF_ASSIGN_OR_RETURN(Description description,
                      Describe(mesh, soft_tissue, source, mouth.ok() ? &*mouth : nullptr,
                               bone.segments, recipe, options.threads, &progress));
  progress.Begin(source.surface_roles.empty() ? "comparing the mesh with the CT's skin"
                                              : "comparing the mesh with the given skin",
                 0.96, 0.98);
  TF_ASSIGN_OR_RETURN(
      SkinCoverage coverage,
      MeasureSkinCoverage(anatomy.head, anatomy.landmarks,
                          {mesh.surface, description.released.regions, soft_tissue.region,
                           &soft_tissue.outside_air, mouth.ok() ? &*mouth : nullptr},
                          source.spacing_mm.maxCoeff(), options.threads));
  std::optional<PartedLips> lips;
  if (seam) {
    TF_ASSIGN_OR_RETURN(lips, PartLips(*seam,
                                       {.parts = anatomy.parts.labels,
                                        .soft_tissue = soft_tissue.labels,
                                        .up = anatomy.frame.superior,
                                        .vestibule_mm = recipe.lips.vestibule_mm},
                                       &mesh, &description.released.regions));
  }
  progress.Begin("extracting surfaces for the viewer", 0.98, 1);
  TF_ASSIGN_OR_RETURN(std::vector<CaseSurface> shown, viewer_surfaces.get());
  soft_tissue.outside_air = {};  // as large as the CT's grid, and not asked for any more
  ReportStage(options.on_stage, "done", 1);
  return PlanBuild{.recipe = recipe,
                   .ct = std::move(source.provenance),
                   .surface_roles = std::move(source.surface_roles),
                   .values = std::move(source.values),
                   .ct_size = source.size,
                   .ct_spacing_mm = source.spacing_mm,
                   .metal = std::move(source.metal),
                   .carried_skin = std::move(source.carried_skin),
                   .before_correction = std::move(source.before_correction),
                   .head = std::move(anatomy.head),
                   .parts = std::move(anatomy.parts),
                   .bone = std::move(bone.labels),
                   .landmarks = anatomy.landmarks,
                   .segments = std::move(bone.segments),
                   .soft_tissue = std::move(soft_tissue),
                   .contact_band_mm = description.contact_band_mm,
                   .mesh = std::move(mesh),
                   .stiffness = std::move(description.stiffness),
                   .regions = std::move(description.released.regions),
                   .num_released_by_trial = description.released.freed,
                   .num_inverted = description.released.num_inverted,
                   .skin_distance = std::move(description.skin_distance),
                   .coverage = std::move(coverage),
                   .labels = std::move(source.labels),
                   .mouth = std::move(mouth),
                   .lips = std::move(lips),
                   .frankfort = anatomy.frankfort,
                   .head_frame = std::move(anatomy.frame),
                   .viewer_surfaces = std::move(shown)};
}

}  // namespace

absl::StatusOr<PlanBuild> BuildPlan(const std::string& ct_path, const Recipe& recipe,
                                    const PlanBuildOptions& options) {
  Progress progress(options.on_stage);
  SetFilterThreads(options.threads);
  Recipe planned = recipe;
  TF_ASSIGN_OR_RETURN(Source source, SourceOfCt(ct_path, &planned, options.threads, &progress));
  return BuildFromSource(std::move(source), planned, options, progress);
}

absl::StatusOr<PlanBuild> BuildPlanFromSurfaces(const std::string& path,
                                                const PlanBuildOptions& options) {
  Progress progress(options.on_stage);
  SetFilterThreads(options.threads);
  progress.Begin("reading the surfaces", 0, 0.12);
  TF_ASSIGN_OR_RETURN(SurfacesInput input, ReadSurfaces(path, options.threads));
  const Recipe recipe = input.recipe;
  TF_ASSIGN_OR_RETURN(Source source,
                      SourceOfSurfaces(std::move(input), options.threads, &progress));
  return BuildFromSource(std::move(source), recipe, options, progress);
}

}  // namespace tissueform
