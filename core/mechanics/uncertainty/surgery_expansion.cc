// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/uncertainty/surgery_expansion.h"

#include <algorithm>
#include <numbers>
#include <utility>

#include <Eigen/QR>

#include "core/base/status_macros.h"
#include "core/mechanics/constraints/rigid_pose.h"
#include "core/mechanics/uncertainty/held_contact.h"

namespace tissueform {
namespace {

constexpr int kVariablesPerHandle = 6;
// Translations are linear, turns nearly so over this: of a standard deviation, each way.
constexpr double kStep = 1e-3;
// The front of a segment is the mean of this part of its vertices, the foremost ones.
constexpr int kFrontPart = 10;

// Where the segment's front goes: LPS, mm.
Eigen::Vector3d MovedFront(const HandleRegion& handle, const Positions& rest,
                           const Eigen::Vector3d& back, const HandlePose& pose) {
  std::vector<int32_t> vertices = handle.vertices;
  const auto count = std::max<size_t>(1, vertices.size() / kFrontPart);
  std::ranges::nth_element(vertices, vertices.begin() + static_cast<std::ptrdiff_t>(count - 1), {},
                           [&](int32_t v) { return rest.row(v).dot(back); });
  vertices.resize(count);
  const Eigen::Vector3d front = rest(vertices, Eigen::all).colwise().mean();
  return ApplyPose(pose, front);
}

// `pose`, and then a small turn about `place` and a shift.
HandlePose Missed(const HandlePose& pose, const Eigen::Vector3d& place, const Eigen::Vector3d& turn,
                  const Eigen::Vector3d& shift) {
  RigidMove miss{.rotation = RotationMatrix(turn)};
  miss.translation_mm = place - miss.rotation * place + shift;
  return PoseOf(Composed(miss, MoveOf(pose)), pose.pivot_mm);
}

// A segment that the plan leaves in place is taken as not operated on.
bool IsOperated(const HandlePose& pose) {
  return !pose.rotation_vector.isZero(0) || !pose.translation_mm.isZero(0) || pose.scale != 1;
}

// What a change of the poses' coefficients does while the rows that press stay closed.
class Responder {
 public:
  Responder(const ElasticSystem& elastic, const ElasticContact& contact,
            const std::vector<int32_t>& held_rows)
      : elastic_(elastic), contact_(contact) {
    for (size_t u = 0; u < contact.rows().size(); ++u) {
      if (std::ranges::binary_search(held_rows, contact.rows()[u])) {
        closed_.push_back(static_cast<Eigen::Index>(u));
      }
    }
    if (!closed_.empty()) compliance_.compute(contact.compliance()(closed_, closed_));
  }

  absl::StatusOr<Eigen::VectorXd> Respond(const Eigen::VectorXd& coefficients) const {
    Eigen::VectorXd moved = elastic_.response_columns() * coefficients;
    if (closed_.empty()) return moved;
    const Eigen::VectorXd opened = contact_.gap_columns() * coefficients;
    const Eigen::VectorXd pressed = compliance_.solve(-opened(closed_));
    Eigen::VectorXd forces = Eigen::VectorXd::Zero(opened.size());
    forces(closed_) = pressed;
    TF_ASSIGN_OR_RETURN(
        const Eigen::VectorXd pushed,
        contact_.Displacements({forces.data(), static_cast<size_t>(forces.size())}));
    return moved + pushed;
  }

 private:
  const ElasticSystem& elastic_;
  const ElasticContact& contact_;
  std::vector<Eigen::Index> closed_;
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> compliance_;
};

}  // namespace

absl::StatusOr<AnswerExpansion> ExpandSurgery(MeshPreparation* preparation,
                                              absl::Span<const HandlePose> poses,
                                              const Positions& deformed,
                                              const Eigen::Matrix3d& axes,
                                              const SurgeryDeviation& deviation) {
  TF_ASSIGN_OR_RETURN(const ElasticSystem* elastic, preparation->Elastic());
  TF_ASSIGN_OR_RETURN(const ElasticContact* contact, preparation->Contact());
  const ConstraintSet& constraints = preparation->constraints();
  const Positions& rest = preparation->mesh().positions();
  const Responder responder(*elastic, *contact,
                            HeldRows(constraints, rest, poses, deformed, false));
  AnswerExpansion expansion;
  for (size_t h = 0; h < poses.size(); ++h) {
    if (!IsOperated(poses[h])) continue;
    const Eigen::Vector3d front = MovedFront(constraints.handles()[h], rest, axes.col(1), poses[h]);
    for (int v = 0; v < kVariablesPerHandle; ++v) {
      const int axis = v % 3;
      Eigen::Vector3d turn = Eigen::Vector3d::Zero();
      Eigen::Vector3d shift = Eigen::Vector3d::Zero();
      if (v < 3) {
        shift = deviation.translation_mm[axis] * axes.col(axis);
      } else {
        turn = deviation.rotation_deg[axis] * std::numbers::pi / 180 * axes.col(axis);
      }
      const auto at = [&](double step) {
        std::vector<HandlePose> changed(poses.begin(), poses.end());
        changed[h] = Missed(poses[h], front, step * turn, step * shift);
        return elastic->Coefficients(changed);
      };
      TF_ASSIGN_OR_RETURN(const Eigen::VectorXd field,
                          responder.Respond((at(kStep) - at(-kStep)) / (2 * kStep)));
      expansion.terms.push_back({.first = expansion.variables++, .field = field});
    }
  }
  return expansion;
}

void Append(const AnswerExpansion& more, AnswerExpansion* expansion) {
  for (AnswerExpansion::Term term : more.terms) {
    term.first += expansion->variables;
    if (term.second != AnswerExpansion::kNone) term.second += expansion->variables;
    expansion->terms.push_back(std::move(term));
  }
  expansion->variables += more.variables;
}

}  // namespace tissueform
