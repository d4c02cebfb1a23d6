// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/nifti_header.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>

namespace tissueform {
namespace {

using Form = NiftiHeader::Form;

constexpr double kRounding = 1e-2;  // of unit vectors; a real shear is more
constexpr double kSquare = 1e-6;
constexpr double kMaxTiltDeg = 35;  // as ArrangeStack's

// Offsets of the fields.
constexpr size_t kBitsPerVoxel = 72;
constexpr size_t kPixdim = 76;
constexpr size_t kVoxelOffset = 108;
constexpr size_t kUnits = 123;
constexpr size_t kQformCode = 252;
constexpr size_t kSformCode = 254;
constexpr size_t kQuaternion = 256;  // three numbers, then the place of voxel 0
constexpr size_t kSform = 280;
constexpr size_t kMagic = 344;

class Fields {
 public:
  Fields(absl::string_view bytes, bool swap) : bytes_(bytes), swap_(swap) {}

  // The number at an offset, or one of those that follow it.
  template <typename T>
  T At(size_t offset, size_t index = 0) const {
    std::array<char, sizeof(T)> raw;
    std::memcpy(raw.data(), bytes_.data() + offset + index * sizeof(T), sizeof(T));
    if (swap_) std::reverse(raw.begin(), raw.end());
    T value;
    std::memcpy(&value, raw.data(), sizeof(T));
    return value;
  }

  Eigen::Vector3d VectorAt(size_t offset, size_t first) const {
    return {At<float>(offset, first), At<float>(offset, first + 1), At<float>(offset, first + 2)};
  }

 private:
  absl::string_view bytes_;
  bool swap_;
};

// Rotation by a quaternion of length 1 whose real part is not stored; pixdim[0] < 0 mirrors k.
Form QformOf(const Fields& fields) {
  const Eigen::Vector3d imaginary = fields.VectorAt(kQuaternion, 0);
  const double real = std::sqrt(std::max(0.0, 1 - imaginary.squaredNorm()));
  const Eigen::Quaterniond turn(real, imaginary.x(), imaginary.y(), imaginary.z());
  Eigen::Vector3d spacing = fields.VectorAt(kPixdim, 1);
  if (fields.At<float>(kPixdim) < 0) spacing.z() *= -1;
  Form form;
  form << turn.normalized().toRotationMatrix() * spacing.asDiagonal(),
      fields.VectorAt(kQuaternion, 3);
  return form;
}

Form SformOf(const Fields& fields) {
  Form form;
  for (size_t row = 0; row < 3; ++row) {
    for (size_t column = 0; column < 4; ++column) {
      form(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(column)) =
          fields.At<float>(kSform, 4 * row + column);
    }
  }
  return form;
}

double Handedness(const Form& form) { return form.leftCols<3>().determinant(); }

// The nearest directions that are square to each other.
template <typename Matrix>
Matrix MadeSquare(const Matrix& directions) {
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(directions,
                                              Eigen::ComputeThinU | Eigen::ComputeThinV);
  return svd.matrixU() * svd.matrixV().transpose();
}

absl::Status TakeAxes(const Eigen::Matrix3d& axes, CtVolume* volume) {
  const double in_plane = std::abs(axes.col(0).dot(axes.col(1)));
  const double along_rows = std::abs(axes.col(0).dot(axes.col(2)));
  const double along_columns = std::abs(axes.col(1).dot(axes.col(2)));
  const double worst = std::max({in_plane, along_rows, along_columns});
  volume->direction = MadeSquare(axes);
  if (worst <= kSquare) return absl::OkStatus();
  if (worst <= kRounding) {
    volume->provenance.notes.push_back(absl::StrFormat(
        "the file's axes are not exactly square to each other (cosine up to %.1e): they are made "
        "so",
        worst));
    return absl::OkStatus();
  }
  const double angle_deg = std::asin(std::min(1.0, along_columns)) * 180 / M_PI;
  if (in_plane > kRounding || along_rows > kRounding || angle_deg > kMaxTiltDeg) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "the file's axes are sheared (cosines between them: %.3f, %.3f, %.3f), and not as a tilted "
        "gantry does it; resample it upright",
        in_plane, along_rows, along_columns));
  }
  const Eigen::Matrix<double, 3, 2> plane =
      MadeSquare(Eigen::Matrix<double, 3, 2>(axes.leftCols<2>()));
  volume->direction << plane, axes.col(2);
  Eigen::Vector3d up = Eigen::Vector3d(plane.col(0)).cross(Eigen::Vector3d(plane.col(1)));
  if (up.dot(axes.col(2)) < 0) up = -up;
  volume->provenance.gantry_tilt_deg =
      std::atan2(plane.col(0).dot(Eigen::Vector3d(axes.col(2)).cross(up)), axes.col(2).dot(up)) *
      180 / M_PI;
  return absl::OkStatus();
}

}  // namespace

std::optional<NiftiHeader> ParseNiftiHeader(absl::string_view start) {
  if (start.size() < kNiftiHeaderBytes || start.substr(kMagic, 3) != "n+1") return std::nullopt;
  for (const bool swap : {false, true}) {
    const Fields fields(start, swap);
    if (fields.At<int32_t>(0) != static_cast<int32_t>(kNiftiHeaderBytes)) continue;
    NiftiHeader header;
    if (fields.At<int16_t>(kQformCode) > 0) header.qform = QformOf(fields);
    if (fields.At<int16_t>(kSformCode) > 0) header.sform = SformOf(fields);
    header.unit = fields.At<uint8_t>(kUnits) & 7;
    header.voxel_offset = fields.At<float>(kVoxelOffset);
    header.voxel_bits = fields.At<int16_t>(kBitsPerVoxel);
    return header;
  }
  return std::nullopt;
}

absl::Status CheckForms(const NiftiHeader& header) {
  if (!header.qform || !header.sform ||
      !(Handedness(*header.qform) * Handedness(*header.sform) < 0)) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      "the file's qform and sform mirror each other, so that left and right of the patient are "
      "uncertain; find out which one is right and set the code of the other to 0");
}

absl::Status PlaceByHeader(const NiftiHeader& header, CtVolume* volume) {
  Form form = header.sform ? *header.sform : *header.qform;
  form.topRows<2>() *= -1;  // RAS to LPS
  if (header.NeedsScale()) {
    form *= header.unit == 1 ? 1000 : 0.001;
    volume->provenance.notes.push_back(absl::StrCat("the file states ",
                                                    header.unit == 1 ? "meters" : "micrometers",
                                                    " (xyzt_units): converted to mm"));
  }
  const Eigen::Vector3d spacing = form.leftCols<3>().colwise().norm();
  if (!form.allFinite() || !(spacing.minCoeff() > 0)) {
    return absl::InvalidArgumentError("the file places its voxels at no finite position");
  }
  volume->spacing_mm = spacing;
  volume->origin_mm = form.col(3);
  return TakeAxes(form.leftCols<3>() * spacing.cwiseInverse().asDiagonal(), volume);
}

}  // namespace tissueform
