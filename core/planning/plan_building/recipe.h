// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"

#include "core/imaging/anatomy/head_segmentation.h"
#include "core/imaging/anatomy/osteotomy.h"
#include "core/imaging/anatomy/plane.h"
#include "core/imaging/anatomy/soft_tissue.h"
#include "core/imaging/anatomy/stiffness_table.h"
#include "core/imaging/ct/ct_volume_reader.h"
#include "core/imaging/labels/label_map.h"
#include "core/imaging/metal/metal_reduction.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/mechanics/deformation/model.h"
#include "core/planning/plan_building/given_landmarks.h"
#include "core/planning/plan_building/segment_files.h"
#include "core/planning/plan_building/surface_source.h"

namespace tissueform {

// A piece of bone that moves, and where to.
struct RecipeSegment {
  std::string name;
  OsteotomyKind kind = OsteotomyKind::kBssro;
  std::vector<Plane> planes;  // empty: from the anatomy
  HandlePose pose;            // LPS, radians and mm
  // The piece itself, in place of an osteotomy: all segments have one, or none has.
  std::optional<SurfaceSource> surface = {};
  bool kind_given = true;   // otherwise the CT shows to which jaw the surface belongs
  MoveSource move = {};     // what the pose is to be read from (given_pieces.h)
  double dissected_mm = 0;  // FreeBands::dissected_mm
};

struct RecipeMesh {
  double edge_mm = 3.5;
  double fine_edge_mm = 2.5;  // at lips and chin
  double interior_edge_factor = 1.5;
  double min_dihedral_deg = 10;
};

// Whether and where the lips part.
struct RecipeLips {
  bool part = false;
  std::vector<Eigen::Vector3d> mouth_line_mm;  // LPS, from right to left; empty: found in the CT
  double vestibule_mm = 10;  // so far from the mouth line tissue slides on the jaws
};

// A label map that says what thresholds would have to find.
struct RecipeLabels {
  std::string file;  // empty: none
  std::vector<LabelRule> names;
  std::string convention;  // LabelReadOptions::convention
};

// How a planning model is made from a CT of a head (docs/recipe-format.md). Coordinates are LPS,
// mm.
struct Recipe {
  std::string sha256;  // of the text that was parsed; empty for a recipe that was not read
  CtReadOptions ct;
  RecipeLabels labels;
  MetalOptions metal;
  double spacing_mm = 1.5;
  HeadSegmentationOptions segmentation;
  std::optional<Plane> occlusal_plane;
  std::vector<RecipeSegment> segments;  // at least one
  SurfaceAxes surface_axes;             // of the segments' surfaces
  GivenLandmarks landmarks;
  std::optional<Plane> back;  // of the region of interest
  std::optional<Plane> above;
  std::optional<Plane> below;
  std::optional<Plane> midsagittal;  // of the head frame
  std::optional<Plane> horizontal;
  SoftTissueOptions soft_tissue;
  RecipeMesh mesh;
  RecipeLips lips;
  std::optional<double> contact_band_mm;
  StiffnessTable tissues = DefaultStiffnessTable();
  double poisson_ratio = 0.45;
  DeformationModel model = DeformationModel::kGradientField;
};

// The text of docs/recipe.schema.json.
const char* RecipeSchemaText();

// Largest recipe file that is read.
inline constexpr size_t kMaxRecipeBytes = size_t{1} << 20;

// Reads and checks a recipe against the published schema, docs/recipe.schema.json, which is built
// into the program, in the version that the file says.
//
// Reads markups files that it names; label maps, surfaces and transforms are left to BuildPlan.
//
// Errors: NotFound (no such file), InvalidArgument (not JSON, unknown key, wrong type, value out of
// range, two segments of one name, a normal of length 0, tissues out of order; the message names
// the key as a JSON pointer); those of InsertMarkups.
absl::StatusOr<Recipe> ReadRecipe(const std::string& path);

// The same for a text, whose SHA-256 it keeps; `name` stands for the file in messages. Files that
// the text names are files of `folder`; without a folder it must not name any.
absl::StatusOr<Recipe> ParseRecipe(std::string_view json, const std::string& name,
                                   const std::optional<std::string>& folder = std::nullopt);

// The recipe with everything that was left out filled in: what report.json states.
std::string RecipeToJson(const Recipe& recipe);

}  // namespace tissueform
