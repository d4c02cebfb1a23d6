// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/segment_move.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "core/base/status_macros.h"
#include "core/mesh/generation/rigid_registration.h"

namespace tissueform {
namespace {

constexpr double kLargestStretch = 1e-3;
constexpr double kLargestRmsMm = 1.5;
constexpr double kLargestShiftMm = 1e6;
constexpr Eigen::Index kFitPoints = 3000;
constexpr int kMaxFitRounds = 200;

// What the file says of one transform: kind, parameters, center.
struct ItkText {
  std::string kind;
  std::vector<double> parameters;
  std::vector<double> fixed;
};

absl::StatusOr<std::vector<double>> Numbers(absl::string_view text) {
  std::vector<double> numbers;
  for (const absl::string_view word : absl::StrSplit(text, ' ', absl::SkipWhitespace())) {
    double number = 0;
    if (!absl::SimpleAtod(word, &number) || !std::isfinite(number)) {
      return absl::InvalidArgumentError("a parameter of the transform is not a number");
    }
    numbers.push_back(number);
  }
  return numbers;
}

absl::StatusOr<ItkText> Split(const std::string& text) {
  if (!absl::StartsWith(text, "#Insight Transform File")) {
    return absl::InvalidArgumentError(
        "the file is not a text file of ITK transforms: it does not begin with \"#Insight "
        "Transform "
        "File\"; save the transform as .tfm or .txt");
  }
  ItkText itk;
  for (absl::string_view line : absl::StrSplit(text, '\n')) {
    line = absl::StripAsciiWhitespace(line);
    if (absl::ConsumePrefix(&line, "Transform:")) {
      if (!itk.kind.empty()) {
        return absl::InvalidArgumentError(
            "the file holds several transforms; harden them into one and save it again");
      }
      itk.kind = std::string(absl::StripAsciiWhitespace(line));
    } else if (absl::ConsumePrefix(&line, "Parameters:")) {
      TF_ASSIGN_OR_RETURN(itk.parameters, Numbers(line));
    } else if (absl::ConsumePrefix(&line, "FixedParameters:")) {
      TF_ASSIGN_OR_RETURN(itk.fixed, Numbers(line));
    }
  }
  return itk;
}

Eigen::Matrix3d About(double angle, const Eigen::Vector3d& axis) {
  return Eigen::AngleAxisd(angle, axis).toRotationMatrix();
}

// The matrix of a transform by its kind; empty where the numbers do not fit the kind.
std::optional<Eigen::Matrix3d> MatrixOf(const ItkText& itk) {
  const std::vector<double>& p = itk.parameters;
  const auto is = [&](absl::string_view kind) { return absl::StartsWith(itk.kind, kind); };
  if ((is("AffineTransform") || is("MatrixOffsetTransformBase")) && p.size() == 12) {
    return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(p.data());
  }
  if (is("TranslationTransform") && p.size() == 3) return Eigen::Matrix3d::Identity();
  if (is("VersorRigid3DTransform") && p.size() == 6) {
    const Eigen::Vector3d versor(p[0], p[1], p[2]);
    const double w = std::sqrt(std::max(0.0, 1 - versor.squaredNorm()));
    return Eigen::Quaterniond(w, p[0], p[1], p[2]).normalized().toRotationMatrix();
  }
  if (is("Euler3DTransform") && p.size() == 6) {
    const Eigen::Matrix3d x = About(p[0], Eigen::Vector3d::UnitX());
    const Eigen::Matrix3d y = About(p[1], Eigen::Vector3d::UnitY());
    const Eigen::Matrix3d z = About(p[2], Eigen::Vector3d::UnitZ());
    // The fourth fixed parameter is ITK's flag for the order ZYX.
    const bool zyx = itk.fixed.size() == 4 && itk.fixed[3] != 0;
    return Eigen::Matrix3d(zyx ? z * y * x : z * x * y);
  }
  return std::nullopt;
}

absl::Status CheckRigid(const Eigen::Matrix3d& matrix) {
  const double stretch =
      (matrix.transpose() * matrix - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (matrix.determinant() < 0) {
    return absl::InvalidArgumentError(
        "the transform mirrors; bone moves without a reflection: register again with a rigid "
        "transform");
  }
  if (stretch <= kLargestStretch) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrFormat(
      "the transform scales or shears by about %.2g %%; bone moves rigidly: register again with a "
      "rigid transform",
      50 * stretch));
}

double RmsOf(const Positions& a, const Positions& b) {
  return std::sqrt((a - b).rowwise().squaredNorm().mean());
}

RigidFit FitByNearest(const TriangleMesh& from, const TriangleMesh& to) {
  const OrientedPoints points = SampleTriangles(from, kFitPoints);
  RigidMove start;
  start.translation_mm =
      (SampleTriangles(to, kFitPoints).points.colwise().mean() - points.points.colwise().mean())
          .transpose();
  const Registration found = SurfaceRegistration(to).Refine(
      points, start, {.compare_normals = false, .max_rounds = kMaxFitRounds});
  return {.move = found.move, .rms_mm = found.all_rms_mm};
}

}  // namespace

absl::StatusOr<RigidMove> ParseItkTransform(const std::string& text) {
  TF_ASSIGN_OR_RETURN(const ItkText itk, Split(text));
  const std::optional<Eigen::Matrix3d> matrix = MatrixOf(itk);
  if (!matrix || itk.parameters.size() < 3) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the transform is not rigid or has the wrong number of parameters (", itk.parameters.size(),
        "); known are AffineTransform, MatrixOffsetTransformBase, Euler3DTransform, "
        "VersorRigid3DTransform and TranslationTransform in 3-D"));
  }
  TF_RETURN_IF_ERROR(CheckRigid(*matrix));
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  if (itk.fixed.size() >= 3) center = {itk.fixed[0], itk.fixed[1], itk.fixed[2]};
  const Eigen::Vector3d shift(itk.parameters.end()[-3], itk.parameters.end()[-2],
                              itk.parameters.end()[-1]);
  const Eigen::Matrix3d rotation = NearestRotation(*matrix);
  const Eigen::Vector3d offset = center + shift - rotation * center;
  if (!(offset.cwiseAbs().maxCoeff() <= kLargestShiftMm)) {
    return absl::InvalidArgumentError("the transform moves by more than 1e6 mm; are its units mm?");
  }
  return Inverse({rotation, offset});
}

absl::StatusOr<RigidFit> FitRigidly(const TriangleMesh& from, const TriangleMesh& to) {
  RigidFit fit;
  if (from.num_vertices() == to.num_vertices() && from.triangles() == to.triangles()) {
    fit.move =
        MoveOnto(from.positions(), to.positions(), Eigen::VectorXd::Ones(from.num_vertices()));
    fit.rms_mm = RmsOf(Moved(from.positions(), fit.move), to.positions());
  } else {
    fit = FitByNearest(from, to);
  }
  if (fit.rms_mm <= kLargestRmsMm) return fit;
  return absl::InvalidArgumentError(absl::StrFormat(
      "the piece and its moved surface differ by %.1f mm RMS after the best rigid fit, more than "
      "%g "
      "mm: they are not the same piece, or one is in another place; give the pose as numbers",
      fit.rms_mm, kLargestRmsMm));
}

std::string MoveText(const HandlePose& pose) {
  const auto along = [](double mm, const char* positive, const char* negative) {
    return absl::StrFormat("%.1f mm %s", std::abs(mm), mm < 0 ? negative : positive);
  };
  const Eigen::Vector3d& t = pose.translation_mm;
  return absl::StrCat("moves ", along(t.y(), "backward", "forward"), ", ",
                      along(t.z(), "up", "down"), ", ", along(t.x(), "left", "right"),
                      absl::StrFormat(", and turns by %.1f degrees",
                                      pose.rotation_vector.norm() * 180 / std::numbers::pi));
}

}  // namespace tissueform
