// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include <Eigen/Core>
#include <Eigen/QR>

#include "core/base/types.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/mechanics/deformation/elastic_contact.h"
#include "core/mechanics/deformation/elastic_system.h"
#include "core/mechanics/deformation/mesh_preparation.h"

namespace tissueform {

// Contact of a body in large deformation. The normal of a row on a handle's bone turns with the
// handle, n = R n_0, and the bone's point goes with its pose; normals on fixed bone and between two
// lips stay, which errs by the square of what lips turn by (docs/accuracy.md, "Contact"). For given
// poses every row is then linear in the displacements, as in ContactRow.
//
// The rows that are met at a time are the bilateral ones and the closed ones, a part of the
// unilateral rows that the user chooses; a search keeps to displacements that meet them. It works
// in local unknowns: 3 v + axis, the axes of a vertex that slides being those of
// ElasticSystem::sliding() turned with its bone, so that bilateral rows prescribe single unknowns.
// Vectors of the unilateral rows are in the order of the constraint set. One thread at a time.
class TurningContact {
 public:
  // All must outlive it. Errors: InvalidArgument (bilateral rows of one vertex on two bones, which
  // may turn into each other).
  static absl::StatusOr<std::unique_ptr<TurningContact>> Create(const MeshPreparation& preparation,
                                                                const ElasticSystem& elastic,
                                                                const ElasticContact& contact);

  // Turns the normals and opens all unilateral rows.
  void SetPoses(absl::Span<const HandlePose> poses);
  // `rows` are indices of unilateral rows among themselves, rising. Costs a back-substitution for
  // each that was not closed before at these poses. Errors: those of the linear solver.
  absl::Status Close(std::vector<int32_t> rows);
  const std::vector<int32_t>& closed() const { return closed_; }

  // Gaps of the unilateral rows, mm, of displacements (#V by 3).
  Eigen::VectorXd Gaps(const Positions& displacements) const;
  // The largest |gap| of a bilateral or closed row: what displacements miss them by, mm.
  double Miss(const Positions& displacements) const;
  // What to add to displacements so that these rows are met: the linear response to closing their
  // gaps. Errors: those of the linear solver.
  absl::StatusOr<Positions> Correction(const Positions& displacements) const;

  // Of vectors of 3 #V unknowns along x, y and z.
  void ToLocal(Eigen::VectorXd* x) const;
  void FromLocal(Eigen::VectorXd* x) const;
  // Of local ones: takes away the part that would change the gap of a bilateral or closed row.
  // Of forces it takes away what these rows bear.
  void Project(Eigen::VectorXd* local) const;
  // Forces of the unilateral rows, in Pa mm^2, in equilibrium with a local gradient of energy; zero
  // for open rows.
  Eigen::VectorXd Forces(const Eigen::VectorXd& local_gradient) const;
  // The local displacements that meet the rows without a change and answer to local forces, by a
  // `solve` of the linear stiffness in local unknowns.
  using Solve = std::function<absl::StatusOr<Eigen::VectorXd>(const Eigen::VectorXd& forces)>;
  absl::StatusOr<Eigen::VectorXd> Respond(const Eigen::VectorXd& forces, const Solve& solve) const;

  // What it holds at most.
  static int64_t BytesNeeded(const ConstraintSet& constraints);

 private:
  using PseudoInverse = Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd>;

  // A vertex that slides: its axes at rest and now, and the bone that turns them.
  struct SlidingVertex {
    Eigen::Index unknown = 0;  // its first
    int bone = ContactRow::kFixedBone;
    Eigen::Matrix3d rest_axes;
    Eigen::Matrix3d axes;
    int num_held = 0;  // of the axes, the first ones
  };

  TurningContact(const MeshPreparation& preparation, const ElasticSystem& elastic,
                 const ElasticContact& contact);

  double Gap(const ContactRow& row, size_t number, const Positions& displacements) const;
  void AddLocalDirections(int32_t vertex, const Eigen::Vector3d& direction, Eigen::Index row,
                          std::vector<Eigen::Triplet<double, int32_t>>* entries) const;
  void MakeDirections();
  absl::Status MakeCompliance(const std::vector<int32_t>& rows);
  // Forces of the closed rows that hold these displacements of them against the linear stiffness.
  Eigen::VectorXd HoldClosed(const Eigen::VectorXd& moved) const {
    return closed_compliance_.solve(moved);
  }

  const MeshPreparation& preparation_;
  const ElasticSystem& elastic_;
  const std::vector<ContactRow>& rows_;
  const std::vector<int32_t>& unilateral_;  // indices in rows_
  std::vector<SlidingVertex> sliding_;      // rising
  std::vector<int32_t> sliding_of_vertex_;  // #V: index in sliding_ or -1

  // At the poses.
  std::vector<Eigen::Vector3d> normals_;  // of all rows
  Eigen::VectorXd resting_gaps_;          // of all rows, see HandleTargets
  std::vector<Eigen::Matrix3d> turns_;    // of the handles
  SparseMatrix directions_;               // local, 3 #V by #unilateral
  Eigen::MatrixXd compliance_;            // columns where has_compliance_
  std::vector<bool> has_compliance_;

  // Of the closed rows.
  std::vector<int32_t> closed_;
  SparseMatrix closed_directions_;
  PseudoInverse closed_gram_;  // of their directions
  PseudoInverse closed_compliance_;
};

}  // namespace tissueform
