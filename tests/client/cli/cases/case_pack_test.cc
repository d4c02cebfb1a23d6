// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <filesystem>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"

#include "client/cpp/plan_session.h"
#include "core/mesh/io/tet_mesh_io.h"
#include "core/planning/case_file/case_reader.h"
#include "core/planning/plan_io.h"
#include "core/planning/planned_contact.h"
#include "proto/conversion/session_conversion.h"
#include "tests/testing/meshes.h"
#include "tests/testing/parted_block.h"
#include "tests/testing/run_tissueform.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

class CasePackTest : public CliTest {
 protected:
  absl::StatusOr<CaseFile> Packed(const std::string& plan,
                                  const std::vector<std::string>& more = {}) const {
    std::vector<std::string> words = {"case", "pack", plan, "--out", "packed.tfcase"};
    words.insert(words.end(), more.begin(), more.end());
    const ProcessResult result = Run(words);
    if (result.exit_code != 0) return absl::InternalError(result.err);
    return ReadCase(Path("packed.tfcase"));
  }
  // The bundled head, or another plan, as a folder of its own that may be changed.
  std::string CopyOf(const std::string& plan) const {
    std::filesystem::copy(TestDataPath("plans/" + plan), Path(plan));
    return Path(plan + "/plan.json");
  }
};

TEST_F(CasePackTest, TheSessionRequestIsThePlans) {
  const std::string path = TestDataPath("plans/three_segments/plan.json");
  ASSERT_OK_AND_ASSIGN(const CaseFile contents, Packed(path));
  ASSERT_OK_AND_ASSIGN(const Plan plan, ReadPlan(path));
  ASSERT_OK_AND_ASSIGN(const PlanProblem problem, ResolvePlan(plan));
  v1::CreateSessionRequest request;
  ASSERT_TRUE(request.ParseFromString(contents.session_request));
  SessionRequestLimits limits;
  limits.num_vertices = problem.mesh->num_vertices();
  ASSERT_OK_AND_ASSIGN(const SessionRequest read, ToSessionRequest(request, limits));
  EXPECT_EQ(read.mesh, MeshNameOf(problem));
  EXPECT_EQ(read.mesh, contents.mesh.name);
  EXPECT_EQ(read.handles, problem.constraints.handles());
  EXPECT_EQ(read.fixed, problem.constraints.fixed());
  EXPECT_TRUE(read.request_id.empty());
  EXPECT_TRUE(read.session_id.empty());
  ASSERT_EQ(contents.handles.size(), problem.poses.size());
  for (size_t h = 0; h < problem.poses.size(); ++h) {
    EXPECT_EQ(contents.handles[h].name, problem.constraints.handles()[h].name);
    EXPECT_LT((contents.handles[h].pose.rotation_vector - problem.poses[h].rotation_vector).norm(),
              1e-12);
    EXPECT_EQ(contents.handles[h].pose.translation_mm, problem.poses[h].translation_mm);
  }
}

TEST_F(CasePackTest, ContactRowsGoWithTheCase) {
  const PartedBlock block;
  ASSERT_THAT(
      WriteTetMesh(Path("block.vtu"), {.mesh = block.mesh, .point_data = {}, .cell_data = {}}),
      IsOk());
  const nlohmann::json plan = {
      {"format", "tissueform-plan"},
      {"version", 4},
      {"unit", "mm"},
      {"coordinate_system", "LPS"},
      {"mesh", "block.vtu"},
      {"stiffness", {{"uniform", 9000}}},
      {"model", "linear_elastic"},
      {"fixed", {{"vertices", PartedBlock::Fixed()}}},
      {"handles", {{{"name", "top"}, {"region", {{"vertices", PartedBlock::Top()}}}}}},
      {"contact", ContactToJson(block.rows, {"top"}, CoordinateSystem::kLps)}};
  Write("plan.json", plan.dump());
  ASSERT_OK_AND_ASSIGN(const CaseFile contents, Packed(Path("plan.json")));
  v1::CreateSessionRequest request;
  ASSERT_TRUE(request.ParseFromString(contents.session_request));
  ASSERT_OK_AND_ASSIGN(const SessionRequest read,
                       ToSessionRequest(request, {.num_vertices = block.mesh.num_vertices()}));
  EXPECT_EQ(read.contact, block.rows);
  ASSERT_TRUE(contents.contact.has_value());
  EXPECT_EQ(contents.contact->rows, static_cast<int64_t>(block.rows.size()));
  ASSERT_EQ(contents.contact->sticking.rows(), 3);
  EXPECT_EQ(contents.contact->sticking.col(0), Eigen::Vector3i(9, 12, 15));
  EXPECT_EQ(contents.contact->sticking.col(1), Eigen::Vector3i(-1, -1, -1));
}

TEST_F(CasePackTest, TheBundledHeadShowsTheWholeHead) {
  ASSERT_OK_AND_ASSIGN(const CaseFile contents, Packed(TestDataPath("plans/head/plan.json")));
  std::vector<SurfaceKind> kinds;
  for (const CaseSurface& surface : contents.surfaces) kinds.push_back(surface.kind);
  EXPECT_THAT(kinds, ElementsAre(SurfaceKind::kSkin, SurfaceKind::kSkin, SurfaceKind::kBone,
                                 SurfaceKind::kTeeth, SurfaceKind::kSegment, SurfaceKind::kTeeth));
  const CaseSurface& skin = contents.surfaces[0];
  ASSERT_TRUE(skin.follows.has_value());
  const Eigen::VectorXf sums = skin.follows->weights.rowwise().sum();
  EXPECT_GT((sums.array() > 0.999F).count(), skin.positions.rows() / 3);  // the face
  EXPECT_GT((sums.array() == 0).count(), skin.positions.rows() / 4);      // what is not modelled
  EXPECT_EQ(contents.handles[0].label, "Lower jaw");
  EXPECT_EQ(contents.head_frame.source, "landmarks");
  EXPECT_THAT(CheckHeadFrame(contents.head_frame), IsOk());
  const auto moves_with_jaw = [&](const char* name) {
    return std::any_of(contents.landmarks.begin(), contents.landmarks.end(),
                       [&](const CaseLandmark& landmark) {
                         return landmark.name == name && landmark.handle == "mandible";
                       });
  };
  EXPECT_TRUE(moves_with_jaw("pogonion"));
  EXPECT_TRUE(moves_with_jaw("lower_incisor"));
  EXPECT_FALSE(moves_with_jaw("upper_incisor"));
}

// Nothing jumps between neighbours: the move of 6 mm is nowhere torn apart but where lips part.
TEST_F(CasePackTest, NeighboursOnTheSkinFollowNeighbouringPlaces) {
  ASSERT_OK_AND_ASSIGN(const CaseFile contents, Packed(TestDataPath("plans/head/plan.json")));
  const CaseSurface& skin = contents.surfaces[0];
  const auto* positions = reinterpret_cast<const double*>(contents.mesh.payload.data());
  const auto followed = [&](int32_t v) {
    Eigen::Vector3d place = Eigen::Vector3d::Zero();
    for (int k = 0; k < 3; ++k) {
      place += double{skin.follows->weights(v, k)} *
               Eigen::Map<const Eigen::Vector3d>(positions + 3 * skin.follows->vertices(v, k));
    }
    return place;
  };
  int64_t torn = 0;
  int64_t edges = 0;
  for (const auto& triangle : skin.triangles.rowwise()) {
    for (int k = 0; k < 3; ++k) {
      const int32_t a = triangle[k];
      const int32_t b = triangle[(k + 1) % 3];
      const bool both_in_full = skin.follows->weights.row(a).sum() > 0.999F &&
                                skin.follows->weights.row(b).sum() > 0.999F;
      if (!both_in_full) continue;
      const double apart = (skin.positions.row(a) - skin.positions.row(b)).norm();
      ++edges;
      torn += (followed(a) - followed(b)).norm() > 3 * apart + 1 ? 1 : 0;
    }
  }
  EXPECT_GT(edges, 10'000);
  EXPECT_LT(torn, edges / 500);
}

TEST_F(CasePackTest, APlanWithoutViewerShowsItsMesh) {
  ASSERT_OK_AND_ASSIGN(const CaseFile contents, Packed(TestDataPath("plans/bar/plan.json")));
  ASSERT_EQ(contents.surfaces.size(), 2U);
  EXPECT_EQ(contents.surfaces[0].kind, SurfaceKind::kSkin);
  EXPECT_EQ(contents.surfaces[1].kind, SurfaceKind::kSegment);
  EXPECT_EQ(contents.head_frame.source, "scanner");
  EXPECT_TRUE(contents.landmarks.empty());
}

TEST_F(CasePackTest, IncludesTheMaterialRanges) {
  const std::string plan = CopyOf("bar");
  std::string text = Read("bar/plan.json");
  const size_t version = text.find("\"version\": 1");
  ASSERT_NE(version, std::string::npos);
  text.replace(version, 12, R"("version": 2, "uncertainty": {"poisson_ratio_95": [0.2, 0.49]})");
  Write("bar/plan.json", text);
  ASSERT_OK_AND_ASSIGN(const CaseFile contents, Packed(plan));
  v1::MaterialRanges ranges;
  ASSERT_TRUE(contents.material_ranges.has_value());
  EXPECT_TRUE(ranges.ParseFromString(*contents.material_ranges));
  EXPECT_EQ(ranges.highest_poisson_ratio(), 0.49);
}

TEST_F(CasePackTest, SurfacesOfAnotherMeshAreRefused) {
  const std::string plan = CopyOf("bar");
  std::filesystem::copy(TestDataPath("plans/head/viewer.glb"), Path("bar/viewer.glb"));
  EXPECT_THAT(Run({"case", "pack", plan, "--out", "packed.tfcase"}),
              FailsWith(1, HasSubstr("belongs to a different mesh")));
  EXPECT_FALSE(std::filesystem::exists(Path("packed.tfcase")));
}

TEST_F(CasePackTest, DamagedSurfacesAreRefusedByName) {
  const std::string plan = CopyOf("bar");
  Write("bar/viewer.glb", "glTF and no more");
  EXPECT_THAT(Run({"case", "pack", plan, "--out", "packed.tfcase"}),
              FailsWith(1, AllOf(HasSubstr("viewer.glb"), HasSubstr("glTF"))));
}

TEST_F(CasePackTest, DoesNotReplaceACaseWithoutOverwrite) {
  const std::string plan = TestDataPath("plans/bar/plan.json");
  Write("packed.tfcase", "mine");
  EXPECT_THAT(Run({"case", "pack", plan, "--out", "packed.tfcase"}),
              FailsWith(1, HasSubstr("--overwrite")));
  EXPECT_EQ(Read("packed.tfcase"), "mine");
  EXPECT_THAT(Packed(plan, {"--overwrite"}), IsOk());
}

TEST_F(CasePackTest, TitleIsPlainTextAndNotTheFolderName) {
  const std::string plan = CopyOf("bar");
  ASSERT_OK_AND_ASSIGN(const CaseFile titled, Packed(plan, {"--title", "<b>Jaw</b>"}));
  EXPECT_EQ(titled.title, "<b>Jaw</b>");
  ASSERT_OK_AND_ASSIGN(const CaseFile untitled, Packed(plan, {"--overwrite"}));
  EXPECT_EQ(untitled.title, "Top");
  EXPECT_THAT(Run({"case", "pack", plan, "--out", "long.tfcase", "--title", std::string(300, 'x')}),
              FailsWith(1, HasSubstr("title")));
}

TEST_F(CasePackTest, AFullDiskLeavesNothing) {
  const ProcessResult result = RunCommandLine(
      {"case", "pack", TestDataPath("plans/bar/plan.json"), "--out", "packed.tfcase"}, folder_,
      1000);
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(Files(), Not(::testing::Contains("packed.tfcase")));
}

}  // namespace
}  // namespace tissueform::testing
