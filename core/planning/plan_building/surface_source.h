// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "nlohmann/json_fwd.hpp"

#include "core/mesh/io/file_space.h"
#include "core/mesh/triangle_mesh.h"

namespace tissueform {

// A surface that a recipe or a surfaces file names.
struct SurfaceSource {
  std::string file;
  bool flip = false;              // turns all triangles
  std::optional<double> wrap_mm;  // wraps the surface at this distance first
};

// Unit and axes of surfaces, as far as they are stated.
struct SurfaceAxes {
  std::optional<double> scale;    // length of one unit in mm; mm are assumed
  std::string coordinate_system;  // "LPS" or "RAS", of files that state none; empty: LPS assumed
};

// Both take JSON that has passed the schema. Relative files are files of `folder`.
SurfaceSource SurfaceFromJson(const nlohmann::json& json, const std::string& folder);
// Errors: InvalidArgument where both "units" and "scale" are given.
absl::StatusOr<SurfaceAxes> SurfaceAxesFromJson(const nlohmann::json& json);

// Reads surfaces, one after the other, into LPS and mm.
class SurfaceReader {
 public:
  SurfaceReader(SurfaceAxes axes, int threads);

  // `role` names the surface in messages and notes. Vertices at exactly one place become one.
  //
  // Errors: those of ReadTriangleMesh and WrapSurface; InvalidArgument where coordinates are not
  // finite or neighbouring triangles face opposite sides.
  absl::StatusOr<TriangleMesh> Read(const SurfaceSource& source, const std::string& role);

  // What was given and what was assumed about unit and axes, one sentence each.
  std::vector<std::string> Notes() const;

  // Of the surfaces that were read, in their order.
  const std::vector<std::string>& roles() const { return roles_; }

  int num_files() const { return num_files_; }
  // SHA-256 of the files, in their order, as one text.
  const std::string& digests() const { return digests_; }

 private:
  absl::StatusOr<TriangleMesh> ReadUnnamed(const SurfaceSource& source, const std::string& role);
  absl::StatusOr<TriangleMesh> Wrapped(const TriangleMesh& mesh, double offset_mm) const;
  absl::Status AddDigest(const std::string& path);

  const SurfaceAxes axes_;
  const int threads_;
  int num_files_ = 0;
  std::string digests_;
  std::vector<std::string> roles_;
  std::map<FileSpace, std::string> roles_by_space_;  // by what their files state
};

}  // namespace tissueform
