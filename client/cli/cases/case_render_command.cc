// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/cases/case_render_command.h"

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <string>
#include <system_error>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include <Eigen/Geometry>

#include "client/cli/prediction/prediction_pictures.h"
#include "core/base/atomic_folder.h"
#include "core/base/status_macros.h"
#include "core/planning/case_file/case_reader.h"
#include "core/planning/case_file/predicted_case.h"
#include "core/planning/rendering/virtual_display.h"
#include "tissueform/v1/session_service.pb.h"

namespace tissueform {
namespace {

struct CaseRenderOptions {
  std::string file;
  std::string positions;
  std::string out;
};

absl::StatusOr<Positions> ReadFloatPositions(const std::string& path, int64_t vertices) {
  FloatPositions read(vertices, 3);
  const auto expected = static_cast<std::streamsize>(read.size() * sizeof(float));
  std::error_code error;
  const uintmax_t size = std::filesystem::file_size(path, error);
  if (error) {
    return absl::NotFoundError(absl::StrCat("cannot read ", path, ": ", error.message()));
  }
  if (size != static_cast<uintmax_t>(expected)) {
    return absl::InvalidArgumentError(absl::StrCat(
        path, " has ", size, " bytes, and ", vertices, " vertices of three float32 need ", expected,
        "; name the positions of a prediction of this case"));
  }
  std::ifstream stream(path, std::ios::binary);
  stream.read(reinterpret_cast<char*>(read.data()), expected);
  if (!stream) return absl::UnavailableError(absl::StrCat("cannot read all of ", path));
  return Positions(read.cast<double>());
}

// A handle's vertices have moved as one body, and three of them say how.
absl::StatusOr<HandlePose> PoseOfVertices(const v1::Handle& handle, const Positions& rest,
                                          const Positions& deformed) {
  const int count = handle.vertices_size();
  Eigen::Matrix3Xd from(3, count);
  Eigen::Matrix3Xd to(3, count);
  for (int i = 0; i < count; ++i) {
    const int32_t v = handle.vertices(i);
    if (v < 0 || v >= rest.rows()) {
      return absl::InvalidArgumentError(
          absl::StrCat("the case's session refers to vertex ", v,
                       ", which its mesh does not have; pack the case again"));
    }
    from.col(i) = rest.row(v);
    to.col(i) = deformed.row(v);
  }
  HandlePose pose;
  if (count == 0) return pose;
  const Eigen::Vector3d middle = from.rowwise().mean();
  pose.pivot_mm = middle;
  pose.translation_mm = to.rowwise().mean() - middle;
  if (count < 3) return pose;
  const Eigen::Matrix4d moved = Eigen::umeyama(from, to, /*with_scaling=*/true);
  const Eigen::Matrix3d linear = moved.topLeftCorner<3, 3>();
  pose.scale = std::cbrt(linear.determinant());
  const Eigen::AngleAxisd turn(Eigen::Matrix3d(linear / pose.scale));
  pose.rotation_vector = turn.angle() * turn.axis();
  return pose;
}

absl::StatusOr<std::map<std::string, HandlePose>> PosesOfHandles(const CaseFile& contents,
                                                                 const Positions& deformed) {
  v1::CreateSessionRequest request;
  if (!request.ParseFromString(contents.session_request)) {
    return absl::InvalidArgumentError("the session of the case cannot be read; pack it again");
  }
  const Positions rest = RestPositions(contents.mesh);
  std::map<std::string, HandlePose> poses;
  for (const v1::Handle& handle : request.handles()) {
    TF_ASSIGN_OR_RETURN(poses[handle.name()], PoseOfVertices(handle, rest, deformed));
    TF_RETURN_IF_ERROR(CheckPose(poses[handle.name()]));
  }
  return poses;
}

absl::Status Render(const CaseRenderOptions& options) {
  TF_RETURN_IF_ERROR(CheckFillable(options.out));
  TF_ASSIGN_OR_RETURN(const CaseFile contents, ReadCase(options.file));
  TF_ASSIGN_OR_RETURN(const Positions deformed,
                      ReadFloatPositions(options.positions, contents.mesh.vertex_count));
  if (!deformed.allFinite()) {
    return absl::InvalidArgumentError(
        absl::StrCat(options.positions, " has a position that is not a number"));
  }
  TF_ASSIGN_OR_RETURN(const auto poses, PosesOfHandles(contents, deformed));
  TF_ASSIGN_OR_RETURN(const PredictedCase predicted, PredictCase(contents, deformed, poses));
  TF_ASSIGN_OR_RETURN(const BeforeAndAfter what, BeforeAndAfterOfCase(contents, predicted, poses));
  TF_ASSIGN_OR_RETURN(const auto display, VirtualDisplay::Open());
  TF_RETURN_IF_ERROR(WriteBeforeAndAfter(what, options.out));
  absl::PrintF("%s in %s\n", absl::StrJoin(BeforeAndAfterPictures(), ", "), options.out);
  return absl::OkStatus();
}

constexpr char kCaseRenderFooter[] =
    "Writes the same pictures as `tissueform prediction export --png`, without a server.\n\n"
    "The pictures show the patient's face: treat them like the CT. Not a medical device.\n\n"
    "Example:\n"
    "  tissueform case render head.tfcase --positions after.f32 --out pictures\n"
    "Exit codes: 0 done, 1 the work failed, 2 wrong use.";

}  // namespace

void AddCaseRenderCommand(CLI::App& command, CommandWork* work) {
  auto options = std::make_shared<CaseRenderOptions>();
  CLI::App* render = command.add_subcommand("render", "pictures of a prediction, before and after");
  render->add_option("CASE", options->file, "the case (docs/case-format.md)")->required();
  render
      ->add_option("--positions", options->positions,
                   "positions of its mesh's vertices: x, y, z in LPS and mm, float32, "
                   "little-endian, as returned by ReadPositions")
      ->required()
      ->type_name("FILE");
  render->add_option("--out", options->out, "an empty or new folder")->required();
  render->footer(kCaseRenderFooter);
  render->callback([options, work] { *work = [options] { return Render(*options); }; });
}

}  // namespace tissueform
