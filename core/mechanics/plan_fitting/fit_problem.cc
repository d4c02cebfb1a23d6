// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/plan_fitting/fit_problem.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

#include "core/base/status_macros.h"
#include "core/mesh/tet_topology.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;

constexpr char kAxisNames[] = "xyz";

std::string PointText(const Vector3d& point) {
  return absl::StrFormat("[%.2f, %.2f, %.2f]", point.x(), point.y(), point.z());
}

absl::Status Refuse(const std::string& what, const std::string& why) {
  return absl::InvalidArgumentError(absl::StrCat(what, ": ", why));
}

class Resolver {
 public:
  Resolver(const FitRequest& request, const TetMesh& mesh, const TriangleIndices& boundary,
           const ConstraintSet& constraints)
      : request_(request),
        mesh_(mesh),
        boundary_(boundary),
        constraints_(constraints),
        signs_(SignsToLps(request.axes)) {}

  absl::StatusOr<FitProblem> Resolve(absl::Span<const HandlePose> poses) {
    TF_RETURN_IF_ERROR(CheckFitRequest(request_));
    problem_.axes = request_.axes;
    problem_.symmetric = request_.symmetric;
    problem_.less_movement = request_.less_movement;
    problem_.tolerance_mm = request_.tolerance_mm;
    problem_.poses.assign(poses.begin(), poses.end());
    for (const HandleRegion& handle : constraints_.handles()) {
      problem_.handle_names.push_back(handle.name);
    }
    TF_RETURN_IF_ERROR(AddUnknowns());
    TF_RETURN_IF_ERROR(AddTargets());
    return std::move(problem_);
  }

 private:
  absl::Status AddUnknowns() {
    for (const FitFreedom& freedom : request_.moving) {
      const auto& names = problem_.handle_names;
      const auto found = std::find(names.begin(), names.end(), freedom.handle);
      if (found == names.end()) {
        return absl::InvalidArgumentError(absl::StrCat("free handle \"", freedom.handle,
                                                       "\": the plan has no such handle; it has ",
                                                       absl::StrJoin(names, ", ")));
      }
      AddUnknownsOf(static_cast<size_t>(found - names.begin()), freedom);
    }
    if (problem_.unknowns.empty()) {
      return absl::InvalidArgumentError(
          request_.symmetric ? "no free numbers; give a handle bounds for a turn about x or a "
                               "translation along y or z, which symmetry leaves"
                             : "no free numbers; give a handle bounds for a rotation or a "
                               "translation");
    }
    if (problem_.unknowns.size() > kMaxFitUnknowns) {
      return absl::InvalidArgumentError(absl::StrCat(problem_.unknowns.size(),
                                                     " free numbers; at most ", kMaxFitUnknowns,
                                                     " are supported (18 for three segments)"));
    }
    return absl::OkStatus();
  }

  void AddUnknownsOf(size_t handle, const FitFreedom& freedom) {
    HandlePose& pose = problem_.poses[handle];
    SetPivot(handle, freedom, &pose);
    if (request_.symmetric) {
      pose.translation_mm.x() = 0;
      pose.rotation_vector.tail<2>().setZero();
    }
    for (const bool is_rotation : {true, false}) {
      for (int axis = 0; axis < 3; ++axis) {
        const auto& ranges = is_rotation ? freedom.rotation : freedom.translation;
        const FitFreedom::Range& range = ranges[static_cast<size_t>(axis)];
        const bool is_held = request_.symmetric && is_rotation != (axis == 0);
        if (!range.has_value() || is_held) continue;
        const auto [lower, upper] = *range;
        problem_.unknowns.push_back({handle, is_rotation, axis, signs_[axis], lower, upper});
      }
    }
  }

  // The same movement about another pivot: x = c + sR (v - c) + t with this t.
  void SetPivot(size_t handle, const FitFreedom& freedom, HandlePose* pose) const {
    const std::vector<int32_t>& vertices = constraints_.handles()[handle].vertices;
    const Vector3d pivot = freedom.pivot_mm.has_value()
                               ? Vector3d(signs_.cwiseProduct(*freedom.pivot_mm))
                               : mesh_.positions()(vertices, Eigen::all).colwise().mean();
    pose->translation_mm = ApplyPose(*pose, pivot) - pivot;
    pose->pivot_mm = pivot;
  }

  absl::Status AddTargets() {
    for (const FitTargetRequest& request : request_.targets) {
      FitTarget target;
      target.name = request.name;
      target.weight = request.weight;
      TF_RETURN_IF_ERROR(FindPoint(request, &target));
      target.rest_mm = PositionOf(target.point, mesh_.positions());
      SetWish(request, &target);
      problem_.targets.push_back(std::move(target));
    }
    return absl::OkStatus();
  }

  absl::Status FindPoint(const FitTargetRequest& request, FitTarget* target) {
    const std::string what = absl::StrCat("target \"", request.name, "\"");
    if (!request.point_mm.has_value()) {
      for (const int32_t v : request.vertices) {
        if (v < 0 || v >= mesh_.num_vertices()) {
          return Refuse(what, absl::StrCat("vertex ", v, " does not exist; the mesh has ",
                                           mesh_.num_vertices()));
        }
      }
      target->point = MeanOfVertices(request.vertices);
      return absl::OkStatus();
    }
    if (!skin_.has_value()) skin_.emplace(mesh_, boundary_, constraints_);
    const SkinFacets& skin = *skin_;
    if (skin.empty()) return Refuse(what, "the mesh has no skin: all of its boundary is held");
    const NearestSkin nearest = skin.Nearest(signs_.cwiseProduct(*request.point_mm));
    if (nearest.distance_mm > kMaxOffSkinMm) {
      return Refuse(
          what,
          absl::StrFormat("point_mm %s lies %.2f mm off the skin (%s; at most %g mm are taken); "
                          "the nearest point of the skin is %s",
                          PointText(*request.point_mm), nearest.distance_mm,
                          skin.IsInTissue(signs_.cwiseProduct(*request.point_mm))
                              ? "in the tissue"
                              : "in the air or in bone",
                          kMaxOffSkinMm, PointText(signs_.cwiseProduct(nearest.position))));
    }
    target->point = nearest.point;
    target->off_skin_mm = nearest.distance_mm;
    return absl::OkStatus();
  }

  void SetWish(const FitTargetRequest& request, FitTarget* target) const {
    if (request.direction.has_value()) {
      // First to about 1, because the square of a large number overflows.
      const double largest = request.direction->cwiseAbs().maxCoeff();
      const Vector3d direction = (*request.direction / largest).normalized();
      target->along = signs_.cwiseProduct(direction).transpose();
      target->wanted_mm = Eigen::VectorXd::Constant(1, request.movement_mm);
      return;
    }
    target->along = Eigen::Matrix3d::Identity();
    target->wanted_mm = request.displacement_mm.has_value()
                            ? signs_.cwiseProduct(*request.displacement_mm)
                            : Vector3d(signs_.cwiseProduct(*request.position_mm) - target->rest_mm);
  }

  const FitRequest& request_;
  const TetMesh& mesh_;
  const TriangleIndices& boundary_;
  const ConstraintSet& constraints_;
  const Vector3d signs_;
  std::optional<SkinFacets> skin_;  // of the first target that asks for it
  FitProblem problem_;
};

}  // namespace

Eigen::Index FitProblem::num_equations() const {
  Eigen::Index count = 0;
  for (const FitTarget& target : targets) count += target.along.rows();
  return count;
}

std::string UnknownName(const FitProblem& problem, const FitUnknown& unknown) {
  return absl::StrCat(
      problem.handle_names[unknown.handle], unknown.is_rotation ? " rotation_" : " translation_",
      absl::string_view(&kAxisNames[unknown.axis], 1), unknown.is_rotation ? "_deg" : "_mm");
}

absl::StatusOr<FitProblem> ResolveFit(const FitRequest& request, const TetMesh& mesh,
                                      const TriangleIndices& boundary,
                                      const ConstraintSet& constraints,
                                      absl::Span<const HandlePose> poses) {
  return Resolver(request, mesh, boundary, constraints).Resolve(poses);
}

absl::StatusOr<FitProblem> ResolveFit(const FitRequest& request, const TetMesh& mesh,
                                      const ConstraintSet& constraints,
                                      absl::Span<const HandlePose> poses) {
  return ResolveFit(request, mesh, BoundaryFacets(mesh), constraints, poses);
}

}  // namespace tissueform
