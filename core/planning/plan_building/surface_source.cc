// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/surface_source.h"

#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "nlohmann/json.hpp"

#include "core/base/status_macros.h"
#include "core/mesh/border_loops.h"
#include "core/mesh/generation/surface_distance.h"
#include "core/mesh/generation/surface_wrapping.h"
#include "core/mesh/io/triangle_mesh_io.h"
#include "core/mesh/payload/sha256.h"
#include "core/mesh/surface_validation.h"

namespace tissueform {
namespace {

// Turned neighbours at more edges than this part make inside and outside unclear.
constexpr double kLargestTurnedFraction = 0.02;

// Vertices at exactly one place become one, as programs write each triangle with corners of its
// own. Triangles that lose a corner by that are left out.
absl::StatusOr<TriangleMesh> Welded(const Positions& positions, const TriangleIndices& triangles) {
  std::map<std::array<double, 3>, int32_t> place_of;
  std::vector<int32_t> vertex(static_cast<size_t>(positions.rows()));
  std::vector<Eigen::RowVector3d> kept;
  for (Eigen::Index v = 0; v < positions.rows(); ++v) {
    const auto [place, is_new] = place_of.try_emplace(
        {positions(v, 0), positions(v, 1), positions(v, 2)}, static_cast<int32_t>(kept.size()));
    if (is_new) kept.emplace_back(positions.row(v));
    vertex[static_cast<size_t>(v)] = place->second;
  }
  std::vector<Eigen::RowVector3i> corners;
  for (const auto& t : triangles.rowwise()) {
    const Eigen::RowVector3i c(vertex[static_cast<size_t>(t[0])], vertex[static_cast<size_t>(t[1])],
                               vertex[static_cast<size_t>(t[2])]);
    if (c[0] != c[1] && c[1] != c[2] && c[2] != c[0]) corners.push_back(c);
  }
  Positions welded(static_cast<Eigen::Index>(kept.size()), 3);
  for (size_t v = 0; v < kept.size(); ++v) welded.row(static_cast<Eigen::Index>(v)) = kept[v];
  TriangleIndices faces(static_cast<Eigen::Index>(corners.size()), 3);
  for (size_t f = 0; f < corners.size(); ++f) faces.row(static_cast<Eigen::Index>(f)) = corners[f];
  return TriangleMesh::Create(std::move(welded), std::move(faces));
}

absl::StatusOr<TriangleMesh> Oriented(const TriangleMesh& mesh) {
  const SurfaceReport report = ValidateTriangleMesh(mesh);
  const MeshDefect* turned = report.Find("turned_triangles");
  if (turned == nullptr || static_cast<double>(turned->count) <=
                               kLargestTurnedFraction * static_cast<double>(report.num_edges)) {
    return mesh;
  }
  return absl::InvalidArgumentError(absl::StrFormat(
      "at %d edges neighbouring triangles face opposite sides, so that inside and outside are "
      "unclear; orient the triangles, or have the surface wrapped (\"wrap_mm\")",
      turned->count));
}

}  // namespace

SurfaceSource SurfaceFromJson(const nlohmann::json& json, const std::string& folder) {
  SurfaceSource source;
  source.file = (std::filesystem::path(folder) / json.at("file").get<std::string>()).string();
  source.flip = json.value("flip", false);
  if (json.contains("wrap_mm")) source.wrap_mm = json.at("wrap_mm").get<double>();
  return source;
}

absl::StatusOr<SurfaceAxes> SurfaceAxesFromJson(const nlohmann::json& json) {
  if (json.contains("units") && json.contains("scale")) {
    return absl::InvalidArgumentError("\"units\" and \"scale\" exclude each other; give one");
  }
  SurfaceAxes axes;
  axes.coordinate_system = json.value("coordinate_system", "");
  const std::string units = json.value("units", "");
  if (!units.empty()) axes.scale = units == "m" ? 1000 : units == "cm" ? 10 : 1;
  if (json.contains("scale")) axes.scale = json.at("scale").get<double>();
  return axes;
}

SurfaceReader::SurfaceReader(SurfaceAxes axes, int threads)
    : axes_(std::move(axes)), threads_(threads) {}

absl::StatusOr<TriangleMesh> SurfaceReader::Read(const SurfaceSource& source,
                                                 const std::string& role) {
  absl::StatusOr<TriangleMesh> mesh = ReadUnnamed(source, role);
  if (mesh.ok()) return mesh;
  return absl::Status(mesh.status().code(), absl::StrCat(role, ": ", mesh.status().message()));
}

std::vector<std::string> SurfaceReader::Notes() const {
  std::vector<std::string> notes;
  notes.push_back(axes_.scale ? absl::StrFormat("One unit of the surfaces is %g mm.", *axes_.scale)
                              : "The surfaces' unit is not given; mm are assumed.");
  for (const auto& [space, roles] : roles_by_space_) {
    const std::string axes = absl::StrCat("Axes of ", roles, ": ");
    if (space == FileSpace::kUnstated) {
      notes.push_back(absl::StrCat(axes, axes_.coordinate_system.empty()
                                             ? "not stated; LPS is assumed."
                                             : axes_.coordinate_system + ", as given."));
    } else {
      notes.push_back(absl::StrCat(axes, space == FileSpace::kRas ? "RAS" : "LPS",
                                   ", as the file's header states."));
    }
  }
  return notes;
}

absl::StatusOr<TriangleMesh> SurfaceReader::ReadUnnamed(const SurfaceSource& source,
                                                        const std::string& role) {
  TF_ASSIGN_OR_RETURN(const TriangleMeshFile file, ReadTriangleMesh(source.file));
  roles_.push_back(role);
  std::string& roles = roles_by_space_[file.space];
  absl::StrAppend(&roles, roles.empty() ? "" : ", ", role);
  TF_RETURN_IF_ERROR(AddDigest(source.file));
  Positions positions = file.mesh.positions() * axes_.scale.value_or(1);
  if (!positions.allFinite()) {
    return absl::InvalidArgumentError("some coordinates are not finite numbers");
  }
  if (file.space == FileSpace::kUnstated && axes_.coordinate_system == "RAS") {
    positions.leftCols(2) *= -1;
  }
  TriangleIndices triangles = file.mesh.triangles();
  if (source.flip) triangles.col(1).swap(triangles.col(2));
  TF_ASSIGN_OR_RETURN(const TriangleMesh mesh, Welded(positions, triangles));
  return source.wrap_mm ? Wrapped(mesh, *source.wrap_mm) : Oriented(mesh);
}

// Openings are closed first: the wrap would enter wide ones and enclose a sheet. Afterwards its
// vertices go back to the surface from the offset, by which bones would be too thick.
absl::StatusOr<TriangleMesh> SurfaceReader::Wrapped(const TriangleMesh& mesh,
                                                    double offset_mm) const {
  WrappingOptions options;
  options.offset_mm = offset_mm;
  options.threads = threads_;
  const TriangleMesh closed = WithOpeningsClosed(mesh, BorderLoops(mesh));
  TF_ASSIGN_OR_RETURN(const WrappedSurface wrapped, WrapSurface(closed, options));
  return TriangleMesh::Create(NearestPoints(closed).Of(wrapped.mesh.positions()),
                              wrapped.mesh.triangles());
}

absl::Status SurfaceReader::AddDigest(const std::string& path) {
  ++num_files_;
  std::ifstream stream(path, std::ios::binary);
  Sha256 digest;
  std::string block(size_t{1} << 20, '\0');
  while (stream.read(block.data(), static_cast<std::streamsize>(block.size())) ||
         stream.gcount() > 0) {
    digest.Add({block.data(), static_cast<size_t>(stream.gcount())});
  }
  if (!stream.eof()) return absl::DataLossError("the file changed while it was read");
  digests_ += digest.Hex();
  return absl::OkStatus();
}

}  // namespace tissueform
