// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <optional>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mechanics/problem/plan_problem.h"
#include "core/mesh/io/tet_mesh_io.h"
#include "core/mesh/validation.h"
#include "core/planning/case_mesh.h"
#include "core/planning/plan_io.h"
#include "core/planning/planned_contact.h"
#include "core/planning/selector.h"
#include "core/planning/stiffness.h"
#include "core/planning/tissue_ranges.h"
#include "core/planning/welded_seam.h"

namespace tissueform {
namespace {

absl::Status CheckUsable(const std::string& name, const TetMesh& mesh) {
  const absl::Status usable = CheckTetMesh(mesh);
  if (usable.ok()) return usable;
  return absl::Status(usable.code(), absl::StrCat("mesh ", name, ": ", usable.message()));
}

// Boxes are in the plan's own axes, so that regions are looked up before the mesh is turned to LPS.
//
// What hangs together with no region has no unique answer. The factorisation would find out, too,
// but know a pivot only; here the message still knows which vertices.
// Vertices that touch bone by `contact` are free, and listed in `freed`.
absl::StatusOr<ConstraintSet> ResolveRegions(const Plan& plan, const TetMeshFile& file,
                                             std::vector<ContactRow> contact,
                                             std::vector<FreedVertex>* freed) {
  const SelectionSource source{file.mesh.positions(), file.point_data};
  TF_ASSIGN_OR_RETURN(std::vector<int32_t> fixed, ResolveSelector(plan.fixed, source, "fixed"));
  std::vector<HandleRegion> handles;
  for (const PlannedHandle& handle : plan.handles) {
    TF_ASSIGN_OR_RETURN(
        std::vector<int32_t> vertices,
        ResolveSelector(handle.region, source, absl::StrCat("handle \"", handle.name, "\"")));
    handles.push_back({handle.name, std::move(vertices)});
  }
  TF_ASSIGN_OR_RETURN(*freed, FreeTouchingVertices(contact, &fixed, &handles));
  TF_ASSIGN_OR_RETURN(
      ConstraintSet constraints,
      ConstraintSet::Create(file.mesh, std::move(fixed), std::move(handles), std::move(contact)));
  TF_RETURN_IF_ERROR(
      CheckEveryComponentConstrained(file.mesh.tets(), file.mesh.num_vertices(), constraints));
  return constraints;
}

absl::StatusOr<std::vector<HandlePose>> ResolvePoses(const Plan& plan) {
  std::vector<HandlePose> poses;
  for (const PlannedHandle& handle : plan.handles) {
    // The schema has seen to types and signs; how large a number may be is known here.
    if (const absl::Status legal = CheckPose(handle.pose); !legal.ok()) {
      return absl::Status(legal.code(),
                          absl::StrCat("handle \"", handle.name, "\": ", legal.message()));
    }
    poses.push_back(SwapToOrFromLps(plan.coordinate_system, handle.pose));
  }
  return poses;
}

absl::StatusOr<std::shared_ptr<const TetMesh>> ToLps(CoordinateSystem system, const TetMesh& mesh) {
  Positions positions = mesh.positions();
  SwapToOrFromLps(system, &positions);
  TF_ASSIGN_OR_RETURN(TetMesh in_lps, TetMesh::Create(std::move(positions), mesh.tets()));
  return std::make_shared<const TetMesh>(std::move(in_lps));
}

// The mesh on which tissue sticks.
absl::StatusOr<TetMeshFile> WithoutContact(const std::string& name, TetMeshFile file,
                                           const std::vector<ContactRow>& contact) {
  absl::StatusOr<TetMeshFile> welded = WeldSeam(std::move(file), contact);
  absl::Status usable = welded.ok() ? CheckTetMesh(welded->mesh) : welded.status();
  if (usable.ok()) return welded;
  return absl::Status(usable.code(),
                      absl::StrCat("mesh ", name, " without contact: ", usable.message()));
}

}  // namespace

absl::StatusOr<PlanProblem> ResolvePlan(const Plan& plan, const ResolveOptions& options) {
  const bool is_case = absl::EndsWithIgnoreCase(plan.mesh_path, kCaseEnding);
  TF_ASSIGN_OR_RETURN(TetMeshFile file,
                      is_case ? ReadMeshOfCase(plan.mesh_path) : ReadTetMesh(plan.mesh_path));
  TF_RETURN_IF_ERROR(CheckMeshDigest(plan, file));
  return ResolvePlan(plan, std::move(file), options);
}

absl::StatusOr<PlanProblem> ResolvePlan(const Plan& plan, TetMeshFile file,
                                        const ResolveOptions& options) {
  TF_RETURN_IF_ERROR(CheckUsable(plan.mesh_path, file.mesh));
  TF_ASSIGN_OR_RETURN(std::vector<ContactRow> contact, ResolveContact(plan));
  ContactUse contact_use = contact.empty() ? ContactUse::kNone : ContactUse::kOn;
  if (!options.contact && !contact.empty()) {
    TF_ASSIGN_OR_RETURN(file, WithoutContact(plan.mesh_path, std::move(file), contact));
    contact.clear();
    contact_use = ContactUse::kLeftOut;
  }
  TF_ASSIGN_OR_RETURN(Eigen::VectorXd stiffness,
                      ResolveStiffness(plan.stiffness, file.mesh.num_tets(), file.cell_data));
  TF_ASSIGN_OR_RETURN(std::optional<MaterialUncertainty> uncertainty,
                      ResolveUncertainty(plan, stiffness, file.cell_data));
  std::vector<FreedVertex> freed;
  TF_ASSIGN_OR_RETURN(ConstraintSet constraints,
                      ResolveRegions(plan, file, std::move(contact), &freed));
  TF_ASSIGN_OR_RETURN(std::vector<HandlePose> poses, ResolvePoses(plan));
  TF_ASSIGN_OR_RETURN(std::shared_ptr<const TetMesh> mesh,
                      ToLps(plan.coordinate_system, file.mesh));
  std::optional<LipEdge> lip_edge;
  if (contact_use == ContactUse::kOn) {
    TF_ASSIGN_OR_RETURN(lip_edge, ResolveLipEdge(plan, mesh->positions(), constraints.contact()));
  }
  DeformerOptions deformer;
  deformer.model = plan.model;
  deformer.preparation.poisson_ratio = plan.poisson_ratio;
  deformer.preparation.mesh_is_usable = true;  // CheckUsable
  deformer.gradient_field = plan.gradient_field;
  if (options.seal) deformer.seal = lip_edge;
  return PlanProblem{.mesh = std::move(mesh),
                     .point_data = std::move(file.point_data),
                     .cell_data = std::move(file.cell_data),
                     .written_in = plan.coordinate_system,
                     .stiffness = std::move(stiffness),
                     .constraints = std::move(constraints),
                     .poses = std::move(poses),
                     .contact_use = contact_use,
                     .lip_edge = std::move(lip_edge),
                     .freed = std::move(freed),
                     .deformer = std::move(deformer),
                     .uncertainty = std::move(uncertainty)};
}

}  // namespace tissueform
