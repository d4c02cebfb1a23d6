// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/plan_pictures.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

#include "core/base/status_macros.h"
#include "core/planning/plan_report/coverage_report.h"
#include "core/planning/plan_report/input_words.h"
#include "core/planning/plan_report/label_colours.h"
#include "core/planning/plan_report/metal_report.h"
#include "core/planning/plan_report/mouth_report.h"
#include "core/planning/plan_report/plan_scenes.h"
#include "core/planning/plan_report/slice_pictures.h"
#include "core/planning/plan_report/values_report.h"
#include "core/planning/rendering/figure.h"

namespace tissueform {
namespace {

constexpr int kSceneHeightPx = 560;

absl::Status WriteFigure(const ReportPicture& picture, const Figure& figure,
                         const std::string& folder) {
  return figure.WritePng(absl::StrCat(folder, "/", picture.file));
}

// A figure of one row of scenes.
absl::Status WriteScenes(const ReportPicture& picture, std::vector<Scene> scenes,
                         const std::string& folder) {
  Figure figure(picture.title);
  figure.AddRow(kSceneHeightPx, std::move(scenes));
  return WriteFigure(picture, figure, folder);
}

std::vector<LegendEntry> BoneLegend(const PlanBuild& build) {
  std::vector<LegendEntry> legend = {{"fixed bone", kFixedBoneColour}};
  for (size_t s = 0; s < build.segments.size(); ++s) {
    legend.push_back({build.segments[s].cut.name, SegmentColour(s)});
  }
  return legend;
}

std::vector<LegendEntry> WithTissue(std::vector<LegendEntry> legend, const std::string& name) {
  legend.insert(legend.begin(), {name, kTissueColour});
  return legend;
}

absl::StatusOr<ReportPicture> DrawSlices(const PlanBuild& build, const std::string& folder) {
  const bool of_surfaces = WordsOf(build).of_surfaces;
  ReportPicture picture{
      "slices.png", of_surfaces ? "Voxels from the surfaces" : "The CT and its segmentation",
      absl::StrCat(of_surfaces ? "Four slices of the voxels that the surfaces were filled with."
                               : "Four slices of the resampled CT, with other objects removed.",
                   " Radiological convention: the patient's right (R) is at the left of the "
                   "picture, and the midsagittal "
                   "slice looks to the left."),
      WithTissue(BoneLegend(build), "modeled soft tissue")};
  std::vector<Picture> panels;
  for (const SlicePlane& plane : PlanSlices(build.landmarks)) {
    panels.push_back(DrawSlice(build, plane));
  }
  Figure figure(picture.title);
  figure.AddRow(640, {panels[0], panels[1]});
  figure.AddRow(640, {panels[2], panels[3]});
  TF_RETURN_IF_ERROR(WriteFigure(picture, figure, folder));
  return picture;
}

absl::StatusOr<ReportPicture> DrawLabels(const PlanBuild& build, const std::string& folder) {
  ReportPicture picture{
      "labels.png",
      "Where the label map and the CT disagree on bone",
      "The slices of the picture above. Marrow, pulp and thin walls are labelled as bone and not "
      "dense in the CT. Within a voxel of a label's border the CT decides, elsewhere the label.",
      {{"only in the labels", DifferenceColour(kOnlyInLabels)},
       {"dense in the CT, not labelled", DifferenceColour(kOnlyInImage)},
       {"labelled as another bone", DifferenceColour(kOtherBone)}}};
  std::vector<Picture> panels;
  for (const SlicePlane& plane : PlanSlices(build.landmarks)) {
    panels.push_back(DrawLabelDifference(build, plane));
  }
  Figure figure(picture.title);
  figure.AddRow(640, {panels[0], panels[1]});
  figure.AddRow(640, {panels[2], panels[3]});
  TF_RETURN_IF_ERROR(WriteFigure(picture, figure, folder));
  return picture;
}

absl::StatusOr<ReportPicture> DrawMetal(const PlanBuild& build, const std::string& folder) {
  ReportPicture picture{
      "metal.png",
      "Metal, before and after artifact reduction",
      "Slices of the resampled CT through the largest pieces of metal: above the original "
      "images, below the corrected ones, from which the plan was made.",
      {}};
  if (!build.carried_skin.values.empty()) {
    picture.legend.push_back(
        {"uncertain: skin carried over from clean slices", CarriedSkinColour(1)});
  }
  MetalSlices slices = DrawMetalSlices(build);
  Figure figure(picture.title);
  figure.AddRow(480, std::move(slices.before));
  figure.AddRow(480, std::move(slices.after));
  TF_RETURN_IF_ERROR(WriteFigure(picture, figure, folder));
  return picture;
}

absl::StatusOr<ReportPicture> DrawGrayValues(const PlanBuild& build, const std::string& folder) {
  ReportPicture picture{"gray_values.png",
                        "Gray values and the thresholds from them",
                        "The histogram of the CT. A threshold is half-way between the means of two "
                        "of its three classes: air, soft tissue, bone with enamel; or as the "
                        "recipe sets it.",
                        {}};
  Figure figure(picture.title);
  figure.AddRow(500, std::vector<Chart>{GrayHistogramChart(build)});
  TF_RETURN_IF_ERROR(WriteFigure(picture, figure, folder));
  return picture;
}

absl::StatusOr<ReportPicture> DrawBone(const PlanBuild& build, const std::string& folder) {
  ReportPicture picture{"bone.png", "Bone: fixed and moving",
                        "Isosurfaces of the bone's labels, before the planned move.",
                        BoneLegend(build)};
  TF_ASSIGN_OR_RETURN(std::vector<Scene> scenes, BoneScenes(build));
  TF_RETURN_IF_ERROR(WriteScenes(picture, std::move(scenes), folder));
  return picture;
}

absl::StatusOr<ReportPicture> DrawSkin(const PlanBuild& build, const std::string& folder) {
  ReportPicture picture{"skin.png",
                        "Skin of the mesh and its named regions",
                        "The boundary of the tet mesh, with its edges.",
                        {}};
  for (const auto& [name, region] :
       {std::pair("nose", SkinRegion::kNose), std::pair("upper lip", SkinRegion::kUpperLip),
        std::pair("lower lip", SkinRegion::kLowerLip), std::pair("chin", SkinRegion::kChin),
        std::pair("left cheek", SkinRegion::kLeftCheek),
        std::pair("right cheek", SkinRegion::kRightCheek),
        std::pair("other skin", SkinRegion::kNone)}) {
    picture.legend.push_back({name, SkinRegionColour(region)});
  }
  picture.legend.push_back({"not skin", kCutColour});
  TF_RETURN_IF_ERROR(WriteScenes(picture, SkinScenes(build), folder));
  return picture;
}

absl::StatusOr<ReportPicture> DrawCoverage(const PlanBuild& build, const std::string& folder) {
  const InputWords words = WordsOf(build);
  ReportPicture picture{
      "coverage.png",
      absl::StrCat(Capitalized(words.skin_of_source), ", and where the mesh misses it"),
      absl::StrCat(words.of_surfaces ? "The given skin" : "The outer skin of the CT",
                   " within the region of interest. Red is missing in the mesh."),
      CoverageLegend(build.coverage, words)};
  Figure figure(picture.title);
  std::vector<Scene> scenes = CoverageScenes(build.coverage);
  figure.AddRow(kSceneHeightPx, {scenes[0], scenes[1]});
  figure.AddRow(kSceneHeightPx, {scenes[2], scenes[3]});
  TF_RETURN_IF_ERROR(WriteFigure(picture, figure, folder));
  return picture;
}

absl::StatusOr<ReportPicture> DrawMouth(const PlanBuild& build, const MouthLine& mouth,
                                        const std::string& folder) {
  const ReportPicture picture{
      "mouth.png", "Line between the lips",
      absl::StrCat(Capitalized(WordsOf(build).the_skin),
                   " about the mouth, with the line between the lips; the model ",
                   build.lips ? "parts along it. " : "does not part there. ",
                   absl::StrJoin(DescribeMouthLine(mouth), " ")),
      MouthLegend()};
  TF_RETURN_IF_ERROR(
      WriteScenes(picture, MouthScenes(build.coverage, build.landmarks, mouth), folder));
  return picture;
}

absl::StatusOr<ReportPicture> DrawLipContact(const PlanBuild& build, const std::string& folder) {
  const ReportPicture picture{"lip_contact.png", "What the lips touch",
                              "The part of the mesh's boundary that touches teeth, jaws and the "
                              "other lip, without the rest.",
                              LipContactLegend()};
  TF_RETURN_IF_ERROR(WriteScenes(picture, LipContactScenes(build), folder));
  return picture;
}

absl::StatusOr<ReportPicture> DrawConstraints(const PlanBuild& build, const std::string& folder) {
  ReportPicture picture{
      "constraints.png", "Where tissue is fixed and moved",
      "The tet mesh's boundary on bone, without the rest. In the contact band "
      "between fixed bone and bone that moves it is left free, so that no tissue is torn.",
      WithTissue(BoneLegend(build), "free")};
  picture.legend.push_back({"cut through tissue, fixed", kCutColour});
  picture.legend.push_back({"on bone, free", kFreedColour});
  TF_RETURN_IF_ERROR(WriteScenes(picture, ConstraintScenes(build), folder));
  return picture;
}

absl::StatusOr<ReportPicture> DrawTets(const PlanBuild& build, const std::string& folder) {
  ReportPicture picture{
      "tets.png",
      "Inside the mesh: tets by tissue",
      absl::StrCat("The mesh cut open. The tissue of a tet, and so its stiffness, comes from ",
                   WordsOf(build).of_surfaces ? "the surface of a tissue that it is in."
                                              : "the CT numbers in it."),
      {}};
  for (size_t t = 0; t < build.recipe.tissues.size(); ++t) {
    const TissueClass& tissue = build.recipe.tissues[t];
    picture.legend.push_back(
        {absl::StrCat(tissue.name, ", ", tissue.youngs_modulus_pa / 1000, " kPa"),
         TissueClassColour(t)});
  }
  TF_RETURN_IF_ERROR(WriteScenes(picture, CutScenes(build), folder));
  return picture;
}

// Where a requirement ends: a line from the axis up to the height of the curve.
constexpr double kLeastPercent = 0.01;  // on the logarithmic axis

Curve LimitCurve(const std::string& name, double x, const Curve& beside, CurveStyle style) {
  const auto [low, high] = std::minmax_element(beside.y.begin(), beside.y.end());
  return {.name = name, .x = {x, x}, .y = {*low, *high}, .colour = kOrange, .style = style};
}

absl::StatusOr<ReportPicture> DrawHistograms(const PlanMeasures& measures, const InputWords& words,
                                             const std::string& folder) {
  ReportPicture picture{
      "quality.png",
      "Quality of the mesh",
      absl::StrCat("Left: the smallest dihedral angle of each tet; 99.9 % must "
                   "reach 3 degrees. Right: distance of the mesh's skin ",
                   words.to_skin, "; the mean must be at most 0.6 voxels, and 99 % within 2."),
      {}};
  const Curve angles = HistogramCurve(DihedralHistogram(measures), "tets", kBlue);
  const Curve distances =
      HistogramCurve(SkinDistanceHistogram(measures), "vertices", kBlue, kLeastPercent);
  Figure figure(picture.title);
  figure.AddRow(
      500, std::vector<Chart>{
               {.title = "Smallest dihedral angle",
                .x_title = "angle [degrees]",
                .y_title = "tets [%]",
                .curves = {angles, LimitCurve("3 degrees", 3, angles, CurveStyle::kDashed)}},
               {.title = absl::StrCat("Distance of the skin ", words.to_skin),
                .x_title = "distance [voxels]",
                .y_title = "vertices on skin [%]",
                .logarithmic_y = true,
                .curves = {distances, LimitCurve("0.6 voxels", 0.6, distances, CurveStyle::kDashed),
                           LimitCurve("2 voxels", 2, distances, CurveStyle::kDotted)}}});
  TF_RETURN_IF_ERROR(WriteFigure(picture, figure, folder));
  return picture;
}

}  // namespace

absl::StatusOr<std::vector<ReportPicture>> DrawPlanPictures(const PlanBuild& build,
                                                            const PlanMeasures& measures,
                                                            const std::string& folder) {
  std::vector<ReportPicture> pictures;
  for (const auto draw :
       {DrawSlices, DrawBone, DrawSkin, DrawCoverage, DrawConstraints, DrawTets}) {
    TF_ASSIGN_OR_RETURN(ReportPicture picture, draw(build, folder));
    pictures.push_back(std::move(picture));
  }
  if (build.labels) {
    TF_ASSIGN_OR_RETURN(ReportPicture labels, DrawLabels(build, folder));
    pictures.insert(pictures.begin() + 1, std::move(labels));
  }
  if (build.mouth.ok()) {
    TF_ASSIGN_OR_RETURN(ReportPicture line, DrawMouth(build, *build.mouth, folder));
    pictures.push_back(std::move(line));
  }
  if (build.lips) {
    TF_ASSIGN_OR_RETURN(ReportPicture contact, DrawLipContact(build, folder));
    pictures.push_back(std::move(contact));
  }
  if (build.values.gray) {
    TF_ASSIGN_OR_RETURN(ReportPicture gray, DrawGrayValues(build, folder));
    pictures.insert(pictures.begin() + 1, std::move(gray));
  }
  if (build.metal.any()) {
    TF_ASSIGN_OR_RETURN(ReportPicture metal, DrawMetal(build, folder));
    pictures.insert(pictures.begin() + 1, std::move(metal));
  }
  TF_ASSIGN_OR_RETURN(ReportPicture quality, DrawHistograms(measures, WordsOf(build), folder));
  pictures.push_back(std::move(quality));
  return pictures;
}

}  // namespace tissueform
