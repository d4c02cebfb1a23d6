// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// tissueform-predicted-case PLAN POSES.json OUT.json OUT.f32
//
// What PredictCase gives for a plan's case under other poses than the plan's, by full solves of the
// plan's model: the reference for every number that the planner shows. POSES.json: a list of plans;
// each has ten numbers a handle: rotation vector, pivot, translation, scale. OUT.json: for each
// plan the movement of landmarks and segments in the head frame, mm and degrees. OUT.f32: for each
// plan x y z of the displacement of every vertex of the mesh, then of the position of every vertex
// of every surface.

#include <cstdio>
#include <fstream>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "nlohmann/json.hpp"

#include "client/cli/cases/packed_case.h"
#include "core/base/status_macros.h"
#include "core/mechanics/constraints/head_frame.h"
#include "core/mechanics/deformation/create_deformer.h"
#include "core/planning/case_file/predicted_case.h"

namespace tissueform::testing {
namespace {

using nlohmann::json;
using Rows = std::vector<std::vector<double>>;

std::vector<HandlePose> PosesOf(const Rows& rows) {
  std::vector<HandlePose> poses;
  for (const std::vector<double>& n : rows) {
    poses.push_back({.rotation_vector = {n.at(0), n.at(1), n.at(2)},
                     .pivot_mm = {n.at(3), n.at(4), n.at(5)},
                     .translation_mm = {n.at(6), n.at(7), n.at(8)},
                     .scale = n.at(9)});
  }
  return poses;
}

json Movement(const std::string& name, const Eigen::Vector3d& moved, const HeadFrame& frame) {
  const Eigen::Vector3d parts = frame.ToLps().transpose() * moved;
  return {{"name", name},
          {"leftMm", parts.x()},
          {"forwardMm", -parts.y()},
          {"upMm", parts.z()},
          {"totalMm", moved.norm()}};
}

json NumbersOf(const CaseFile& contents, const PredictedCase& predicted,
               const std::vector<HandlePose>& poses) {
  json landmarks = json::array();
  for (size_t l = 0; l < contents.landmarks.size(); ++l) {
    const CaseLandmark& landmark = contents.landmarks[l];
    landmarks.push_back(Movement(landmark.name, predicted.landmarks_mm[l] - landmark.position_mm,
                                 contents.head_frame));
  }
  json segments = json::array();
  for (size_t h = 0; h < contents.handles.size(); ++h) {
    const CaseHandle& handle = contents.handles[h];
    const HeadAngles angles =
        AnglesFromRotationVector(poses[h].rotation_vector, contents.head_frame);
    json segment = Movement(handle.name, ApplyPose(poses[h], handle.pivot_mm) - handle.pivot_mm,
                            contents.head_frame);
    segment.update(
        {{"pitchDeg", angles.pitch_deg}, {"rollDeg", angles.roll_deg}, {"yawDeg", angles.yaw_deg}});
    segments.push_back(std::move(segment));
  }
  return {{"landmarks", std::move(landmarks)}, {"segments", std::move(segments)}};
}

void WriteFloats(const FloatPositions& positions, std::ofstream* file) {
  file->write(reinterpret_cast<const char*>(positions.data()),
              static_cast<std::streamsize>(positions.size() * sizeof(float)));
}

absl::Status WriteNumbers(const std::string& plan, const std::vector<Rows>& plans,
                          const std::string& json_path, const std::string& floats_path) {
  TF_ASSIGN_OR_RETURN(const OpenedPlan opened, OpenPlan(plan, {}, ""));
  const PlanProblem& problem = opened.problem;
  TF_ASSIGN_OR_RETURN(
      const std::unique_ptr<Deformer> deformer,
      CreateDeformer(*problem.mesh, problem.stiffness, problem.constraints, problem.deformer));
  json numbers = json::array();
  std::ofstream floats(floats_path, std::ios::binary);
  for (const Rows& rows : plans) {
    const std::vector<HandlePose> poses = PosesOf(rows);
    TF_ASSIGN_OR_RETURN(const Deformation answer, deformer->Deform(poses));
    std::map<std::string, HandlePose> by_name;
    for (size_t h = 0; h < poses.size(); ++h) by_name[opened.contents.handles[h].name] = poses[h];
    TF_ASSIGN_OR_RETURN(const PredictedCase predicted,
                        PredictCase(opened.contents, answer.positions, by_name));
    numbers.push_back(NumbersOf(opened.contents, predicted, poses));
    WriteFloats((answer.positions - problem.mesh->positions()).cast<float>(), &floats);
    for (const FloatPositions& surface : predicted.surfaces) WriteFloats(surface, &floats);
  }
  std::ofstream(json_path) << numbers;
  return floats.good() ? absl::OkStatus() : absl::UnavailableError("cannot write the numbers");
}

}  // namespace
}  // namespace tissueform::testing

int main(int argc, char** argv) {
  if (argc != 5) return 2;
  std::ifstream poses(argv[2]);
  const auto plans = nlohmann::json::parse(poses).get<std::vector<tissueform::testing::Rows>>();
  const absl::Status status = tissueform::testing::WriteNumbers(argv[1], plans, argv[3], argv[4]);
  if (!status.ok()) std::fprintf(stderr, "%s\n", std::string(status.message()).c_str());
  return status.ok() ? 0 : 1;
}
