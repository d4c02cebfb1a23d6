// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/outcome/outcome.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <memory>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "core/base/status_macros.h"
#include "core/mechanics/constraints/rigid_pose.h"
#include "core/mechanics/deformation/create_deformer.h"
#include "core/mechanics/deformation/mesh_preparation.h"
#include "core/planning/case_file/predicted_case.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;
using Poses = std::map<std::string, HandlePose>;

constexpr Eigen::Index kUnmovedPoints = 4000;
// Bone above the Frankfort horizontal less this belongs to the skull: no lower jaw, no neck.
constexpr double kSkullBelowMm = 10;
// The forehead begins so far above that horizontal, and is the front of the head.
constexpr double kForeheadAboveMm = 25;
constexpr double kForeheadFrontMm = 20;
// Below: the post-operative scan is the pre-operative one.
constexpr double kNoMoveMm = 0.15;
constexpr double kNoTurnDeg = 0.15;
constexpr double kSameSkinMm = 0.05;
constexpr double kMaxOpeningDeg = 10;
// Of a segment and the post-operative bone. Right ones leave 0.05 to 0.2 mm, one that was not
// scanned 1.2 to 3 mm.
constexpr double kMaxFitMm = 1;
// Of a region; less is said.
constexpr double kWellSeenShare = 0.9;
// Both cheeks stand out by so much more than predicted: more than models err there.
constexpr double kSwellingMm = 2.5;

class Comparison {
 public:
  Comparison(const PlanProblem& problem, const CaseFile& contents, const PostOperativeHead& post,
             const OutcomeOptions& options)
      : problem_(problem), contents_(contents), post_(post), options_(options) {}

  absl::StatusOr<Outcome> Run() {
    TF_RETURN_IF_ERROR(FindSkin());
    TF_ASSIGN_OR_RETURN(const HeadRegistration registration, Register());
    const SignedSurface real(Moved(post_.skin, registration.to_pre));
    Outcome outcome{.by_bone = post_.bone.has_value(),
                    .registration = registration,
                    .segments = {},
                    .opening = {},
                    .predictions = {},
                    .by_settings = {},
                    .by_ratios = {},
                    .real_skin = real.mesh(),
                    .cautions = {}};
    TF_RETURN_IF_ERROR(FindMovements(real, &outcome));
    TF_RETURN_IF_ERROR(Predict(real, &outcome));
    AddCautions(&outcome);
    TF_RETURN_IF_ERROR(CheckSwelling(real, &outcome));
    return outcome;
  }

 private:
  void ReportStage(absl::string_view stage) const {
    if (options_.on_stage) options_.on_stage(stage);
  }

  // A finding is an error, or a caution where findings are accepted.
  absl::Status Find(const std::string& finding, Outcome* outcome) const {
    if (!options_.accept_findings) {
      return absl::FailedPreconditionError(
          absl::StrCat(finding, "; give --accept-findings to compare in spite of it"));
    }
    outcome->cautions.push_back(finding);
    return absl::OkStatus();
  }

  absl::Status FindSkin() {
    const auto found =
        std::ranges::find(contents_.surfaces, SurfaceKind::kSkin, &CaseSurface::kind);
    if (found == contents_.surfaces.end() || found->regions.empty()) {
      return absl::InvalidArgumentError(
          "the pre-operative case has no skin with regions (lips, chin, nose, cheeks); make the "
          "plan with `tissueform plan build`");
    }
    skin_ = static_cast<size_t>(found - contents_.surfaces.begin());
    return absl::OkStatus();
  }

  const CaseSurface& Skin() const { return contents_.surfaces[skin_]; }

  double HeightOf(const Vector3d& place) const {
    return contents_.head_frame.superior.dot(place - contents_.head_frame.origin_mm);
  }
  double FrontOf(const Vector3d& place) const {
    return -contents_.head_frame.posterior.dot(place - contents_.head_frame.origin_mm);
  }

  // Points of the first surface of this kind that moves with no segment, where `keep` says so.
  OrientedPoints Sample(SurfaceKind kind,
                        const std::function<bool(const Vector3d& place)>& keep) const {
    std::vector<Eigen::RowVector3i> triangles;
    const auto surface = std::ranges::find_if(contents_.surfaces, [&](const CaseSurface& s) {
      return s.kind == kind && s.handle.empty();
    });
    if (surface == contents_.surfaces.end()) return {};
    const Positions positions = surface->positions.cast<double>();
    for (const auto& t : surface->triangles.rowwise()) {
      if (keep(positions(t, Eigen::all).colwise().mean())) triangles.emplace_back(t);
    }
    TriangleIndices kept(static_cast<Eigen::Index>(triangles.size()), 3);
    for (size_t i = 0; i < triangles.size(); ++i) {
      kept.row(static_cast<Eigen::Index>(i)) = triangles[i];
    }
    const auto mesh = TriangleMesh::Create(positions, kept);
    return mesh.ok() ? SampleTriangles(*mesh, kUnmovedPoints) : OrientedPoints();
  }

  absl::StatusOr<HeadRegistration> Register() const {
    ReportStage("registering the post-operative scan");
    if (post_.bone) {
      const auto of_skull = [&](const Vector3d& place) { return HeightOf(place) > -kSkullBelowMm; };
      return RegisterHead(Sample(SurfaceKind::kBone, of_skull), *post_.bone, true);
    }
    const auto of_forehead = [&](const Vector3d& place) {
      return HeightOf(place) > kForeheadAboveMm && FrontOf(place) > kForeheadFrontMm;
    };
    return RegisterHead(Sample(SurfaceKind::kSkin, of_forehead), post_.skin, false);
  }

  absl::Status FindMovements(const SignedSurface& real, Outcome* outcome) const {
    ReportStage("measuring the movement of each segment");
    std::optional<TriangleMesh> bone;
    if (post_.bone) bone = Moved(*post_.bone, outcome->registration.to_pre);
    outcome->segments = MeasureSegments(contents_, bone ? &*bone : nullptr);
    TF_RETURN_IF_ERROR(CheckFits(outcome));
    TF_RETURN_IF_ERROR(CheckMoved(*outcome, real));
    outcome->opening = FindOpening(contents_, outcome->segments);
    if (!outcome->opening) return absl::OkStatus();
    const std::string text = absl::StrFormat(
        "the lower jaw is turned by %.1f degrees about its hinge against the plan (positive: the "
        "mouth is more open)",
        outcome->opening->degrees);
    if (std::abs(outcome->opening->degrees) > kMaxOpeningDeg) {
      return Find(absl::StrCat(text, ": the scans show an open mouth against a closed one"),
                  outcome);
    }
    outcome->cautions.push_back(
        absl::StrCat(text, "; predictions from the plan are compared at the scan's opening"));
    return absl::OkStatus();
  }

  absl::Status CheckFits(Outcome* outcome) const {
    for (const SegmentMovement& segment : outcome->segments) {
      if (!segment.measured || segment.rms_mm <= kMaxFitMm) continue;
      TF_RETURN_IF_ERROR(Find(
          absl::StrFormat("the segment \"%s\" was not found in the post-operative bone: the best "
                          "fit leaves %.1f mm RMS (at most %g mm); the scan cuts it off, or the "
                          "bone was cut elsewhere than planned",
                          segment.handle, segment.rms_mm, kMaxFitMm),
          outcome));
    }
    return absl::OkStatus();
  }

  absl::Status CheckMoved(const Outcome& outcome, const SignedSurface& real) const {
    bool rests = true;
    for (const SegmentMovement& segment : outcome.segments) {
      const RigidMove move = MoveOf(segment.real);
      const double way = (move(segment.real.pivot_mm) - segment.real.pivot_mm).norm();
      rests = rests && segment.measured && way < kNoMoveMm && TurnDegrees(move) < kNoTurnDeg;
    }
    const double skin_mm = CompareFaces(Rest(), real).back().predicted_to_real.p95_mm;
    if (!rests && skin_mm > kSameSkinMm) return absl::OkStatus();
    return absl::FailedPreconditionError(
        "nothing has moved between the scans: the post-operative scan is the pre-operative one; "
        "give the scan after the operation");
  }

  ComparedFace Rest() const {
    return {Skin().positions.cast<double>(), Skin().triangles, Skin().regions};
  }

  Poses PosesOf(const Outcome& outcome, bool real) const {
    Poses poses;
    for (const SegmentMovement& segment : outcome.segments) {
      HandlePose pose = real ? segment.real : segment.planned;
      const bool opens = segment.handle == "mandible" || segment.handle == "chin";
      if (!real && opens && outcome.opening) {
        pose = PoseOf(Composed(outcome.opening->hinge, MoveOf(pose)), pose.pivot_mm);
      }
      poses[segment.handle] = pose;
    }
    return poses;
  }

  absl::Status Predict(const SignedSurface& real, Outcome* outcome) {
    ReportStage("preparing the models");
    PreparationOptions preparing = problem_.deformer.preparation;
    preparing.threads = options_.threads;
    TF_ASSIGN_OR_RETURN(const auto preparation,
                        MeshPreparation::Create(*problem_.mesh, problem_.stiffness,
                                                problem_.constraints, preparing));
    before_ = FindOnProfile(Skin().positions.cast<double>(), Skin().triangles, contents_.head_frame,
                            LandmarksOf(contents_));
    std::vector<ComparedPrediction> planned;
    for (const DeformationModel model : options_.models) {
      ReportStage(absl::StrCat("predicting with ", TraitsOf(model).name));
      DeformerOptions of_model = problem_.deformer;
      of_model.model = model;
      TF_ASSIGN_OR_RETURN(const auto deformer, CreateDeformer(preparation, of_model));
      for (const bool is_real : {true, false}) {
        // Without bone there is one movement, the planned one.
        if (is_real && !outcome->by_bone) continue;
        TF_ASSIGN_OR_RETURN(ComparedPrediction prediction,
                            PredictAndCompare(deformer.get(), PosesOf(*outcome, is_real), real));
        prediction.model = std::string(TraitsOf(model).name);
        prediction.movement = is_real ? "real" : "planned";
        (is_real ? outcome->predictions : planned).push_back(std::move(prediction));
      }
    }
    std::ranges::move(planned, std::back_inserter(outcome->predictions));
    AddBaselines(real, outcome);
    return options_.settings ? PredictBySettings(real, outcome) : absl::OkStatus();
  }

  absl::Status PredictBySettings(const SignedSurface& real, Outcome* outcome) const {
    const Poses poses = PosesOf(*outcome, outcome->by_bone);
    const std::vector<ModelSettings> settings = SettingsToTry(problem_);
    SettingsDeformer deformer(problem_, options_.threads);
    for (size_t s = 0; s < settings.size(); ++s) {
      ReportStage(absl::StrFormat("predicting with settings %d of %d", s + 1, settings.size()));
      TF_ASSIGN_OR_RETURN(const Deformation answer, deformer.Deform(settings[s], InOrder(poses)));
      TF_ASSIGN_OR_RETURN(const PredictedCase predicted,
                          PredictCase(contents_, answer.positions, poses));
      outcome->by_settings.push_back({settings[s], CompareFaces(FaceOf(predicted), real)});
    }
    return absl::OkStatus();
  }

  std::vector<HandlePose> InOrder(const Poses& poses) const {
    std::vector<HandlePose> in_order;
    for (const HandleRegion& handle : problem_.constraints.handles()) {
      in_order.push_back(poses.at(handle.name));
    }
    return in_order;
  }

  ComparedFace FaceOf(const PredictedCase& predicted) const {
    return {predicted.surfaces[skin_].cast<double>(), Skin().triangles, Skin().regions};
  }

  absl::StatusOr<ComparedPrediction> PredictAndCompare(Deformer* deformer, const Poses& poses,
                                                       const SignedSurface& real) const {
    TF_ASSIGN_OR_RETURN(const Deformation answer, deformer->Deform(InOrder(poses)));
    TF_ASSIGN_OR_RETURN(const PredictedCase predicted,
                        PredictCase(contents_, answer.positions, poses));
    PlacedLandmarks near;
    for (size_t i = 0; i < contents_.landmarks.size(); ++i) {
      if (contents_.landmarks[i].skin_vertex) {
        near[contents_.landmarks[i].name] = predicted.landmarks_mm[i];
      }
    }
    ComparedPrediction prediction = Compared(FaceOf(predicted), near, real);
    prediction.load = answer.summary.load;
    return prediction;
  }

  ComparedPrediction Compared(ComparedFace face, const PlacedLandmarks& near,
                              const SignedSurface& real) const {
    ComparedPrediction prediction;
    prediction.regions = CompareFaces(face, real);
    prediction.landmarks = CompareLandmarks(
        before_, FindOnProfile(face.positions, face.triangles, contents_.head_frame, near),
        RealLandmarks(near, real), contents_.head_frame);
    prediction.face = std::move(face);
    return prediction;
  }

  PlacedLandmarks RealLandmarks(const PlacedLandmarks& near, const SignedSurface& real) const {
    return FindOnProfile(real.mesh().positions(), real.mesh().triangles(), contents_.head_frame,
                         near);
  }

  void AddBaselines(const SignedSurface& real, Outcome* outcome) const {
    // Where the operated face's landmarks are looked for: as the best model has them.
    PlacedLandmarks near = LandmarksOf(contents_);
    const ComparedPrediction& first = outcome->predictions.front();
    for (const LandmarkComparison& landmark : first.landmarks) {
      near[landmark.name] = before_.at(landmark.name) -
                            landmark.predicted_forward_mm * contents_.head_frame.posterior +
                            landmark.predicted_up_mm * contents_.head_frame.superior;
    }
    ComparedPrediction none;
    none.model = "none";
    none.movement = "none";
    none.face = Rest();
    none.regions = CompareFaces(none.face, real);
    const PlacedLandmarks in_truth = RealLandmarks(near, real);
    none.landmarks = CompareLandmarks(before_, before_, in_truth, contents_.head_frame);
    outcome->predictions.push_back(std::move(none));
    outcome->by_ratios =
        CompareLandmarks(before_, PredictedByRatios(before_, contents_, outcome->segments),
                         in_truth, contents_.head_frame);
  }

  // What a reader of the numbers has to know of them.
  static void AddCautions(Outcome* outcome) {
    for (const ComparedPrediction& prediction : outcome->predictions) {
      if (prediction.load >= 1) continue;
      outcome->cautions.push_back(
          absl::StrFormat("%s reached %.0f %% of the %s movement; its numbers are of that part",
                          prediction.model, 100 * prediction.load, prediction.movement));
    }
    for (const RegionComparison& region : outcome->predictions.front().regions) {
      if (region.compared_share >= kWellSeenShare || region.region == "face") continue;
      outcome->cautions.push_back(absl::StrFormat(
          "%.0f %% of the region %s is on the post-operative scan; its numbers are of that part",
          100 * region.compared_share, region.region));
    }
    if (outcome->by_bone) return;
    outcome->cautions.push_back(
        "the post-operative scan shows no bone: predictions are of the planned movement, and the "
        "errors of model and surgery are mixed");
  }

  absl::Status CheckSwelling(const SignedSurface& real, Outcome* outcome) const {
    const ComparedPrediction& first = outcome->predictions.front();
    const Eigen::VectorXd map = DistanceMap(first.face, real);
    const Eigen::VectorXd areas = VertexAreas(first.face.positions, first.face.triangles);
    for (Eigen::Index v = 0; v < map.size(); ++v) {
      if (std::isfinite(map[v])) outcome->excess_ml += 1e-3 * map[v] * areas[v];
    }
    int swollen = 0;
    double least_mm = INFINITY;
    for (const RegionComparison& region : first.regions) {
      if (region.region != "cheek_left" && region.region != "cheek_right") continue;
      swollen += region.predicted_to_real.mean_mm > kSwellingMm ? 1 : 0;
      least_mm = std::min(least_mm, region.predicted_to_real.mean_mm);
    }
    if (swollen < 2) return absl::OkStatus();
    return Find(absl::StrFormat("both cheeks stand out by %.1f mm or more beyond the prediction "
                                "(the face by %.0f ml): it is swollen; use a later scan",
                                least_mm, outcome->excess_ml),
                outcome);
  }

  const PlanProblem& problem_;
  const CaseFile& contents_;
  const PostOperativeHead& post_;
  const OutcomeOptions& options_;
  size_t skin_ = 0;
  PlacedLandmarks before_;
};

}  // namespace

absl::StatusOr<Outcome> CompareOutcome(const PlanProblem& problem, const CaseFile& contents,
                                       const PostOperativeHead& post,
                                       const OutcomeOptions& options) {
  return Comparison(problem, contents, post, options).Run();
}

}  // namespace tissueform
