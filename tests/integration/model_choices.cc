// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/integration/model_choices.h"

#include <vector>

#include "absl/strings/str_cat.h"

#include "proto/conversion/mesh_conversion.h"

namespace tissueform::testing {
namespace {

constexpr int kPoses = 4;

void SetRegions(const ConstraintSet& regions, const std::string& handle, size_t fixed_left_out,
                v1::SessionRegions* proto) {
  const std::vector<int32_t>& fixed = regions.fixed();
  proto->mutable_fixed_vertices()->Add(fixed.begin(), fixed.end() - fixed_left_out);
  const std::vector<int32_t>& moved = regions.handles().front().vertices;
  proto->add_handles()->set_name(handle);
  proto->mutable_handles(0)->mutable_vertices()->Add(moved.begin(), moved.end());
}

}  // namespace

std::string ChosenId(uint32_t number) { return absl::StrCat("a-session-of-the-model-", number); }

std::string SomeMesh(uint32_t number) {
  switch (number % 10) {
    case 8:
      return MeshName(std::string(64, '0'));
    case 9:
      return "meshes/no name";
    default:
      return NameOfMesh(static_cast<int>(number % kModelMeshes));
  }
}

v1::DeformationModel SomeModel(uint32_t number) {
  switch (number % 8) {
    case 0:
    case 1:
      return v1::DEFORMATION_MODEL_GRADIENT_FIELD;
    case 2:
    case 3:
      return v1::DEFORMATION_MODEL_LINEAR_ELASTIC;
    case 4:
      return kNoModel;
    default:
      return kOwnModel;
  }
}

int SomePoseNumber(uint32_t number) { return static_cast<int>(number % kPoses); }

int32_t SomePageSize(uint32_t number) { return static_cast<int32_t>(number % 5) - 1; }

ModelUpdate SomeUpdate(uint32_t number) {
  const ConstraintSet& regions = MeshOfModel(0).constraints;
  ModelUpdate update;
  v1::UpdateSessionRequest& request = update.request;
  switch (number % 8) {
    case 0:
      update.words = "stiffness 2000";
      request.mutable_stiffness()->set_uniform_pa(2000);
      break;
    case 1:
      update.words = "linear_elastic";
      request.set_model(v1::DEFORMATION_MODEL_LINEAR_ELASTIC);
      break;
    case 2:
      update.words = "handle cap";
      SetRegions(regions, "cap", 0, request.mutable_regions());
      break;
    case 3:
      update.words = "one vertex less is fixed";
      SetRegions(regions, "top", 1, request.mutable_regions());
      break;
    case 4:
      update.words = "Poisson's ratio 0.3";
      request.set_poisson_ratio(0.3);
      break;
    case 5:
      update.words = "nothing";
      update.changes = false;
      break;
    case 6:
      update.words = "stiffness -5";
      update.legal = false;
      request.mutable_stiffness()->set_uniform_pa(-5);
      break;
    default:
      update.words = "stiffness of the mesh";
      request.mutable_stiffness()->set_cell_array("youngs_modulus_pa");
  }
  return update;
}

void Apply(const v1::UpdateSessionRequest& request, ServedSession* session) {
  SessionRequest& recipe = session->recipe;
  const std::string handle = session->handle();
  if (request.stiffness().has_uniform_pa()) recipe.stiffness = request.stiffness().uniform_pa();
  if (request.stiffness().has_cell_array()) recipe.stiffness = request.stiffness().cell_array();
  if (request.has_regions()) {
    const v1::SessionRegions& regions = request.regions();
    recipe.fixed.assign(regions.fixed_vertices().begin(), regions.fixed_vertices().end());
    recipe.handles.front().name = regions.handles(0).name();
  }
  if (request.model() == v1::DEFORMATION_MODEL_LINEAR_ELASTIC) {
    recipe.model = DeformationModel::kLinearElastic;
  }
  if (request.has_poisson_ratio()) recipe.poisson_ratio = request.poisson_ratio();
  if (session->handle() != handle) session->pose.reset();
  session->ready = true;
  session->etag.clear();
}

}  // namespace tissueform::testing
