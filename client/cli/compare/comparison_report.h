// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "nlohmann/json.hpp"

#include "core/base/csv_table.h"
#include "core/base/types.h"
#include "core/mechanics/deformation/comparison.h"
#include "core/mesh/attribute.h"
#include "core/mesh/tet_mesh.h"
#include "core/planning/plan_io.h"

namespace tissueform {

// What the command compare was asked for.
struct CompareOptions {
  std::string a;  // a result, or the plan whose models are compared
  std::string b;  // another result
  std::string by;
  std::string out;  // a file for results, a folder for models
  std::string csv;
  bool json = false;

  // Of models.
  std::vector<std::string> models;
  std::string reference = "neo_hookean";
  PlanReadOptions reading;
  int threads = 1;
  int solver_threads = 1;
};

// How far two results lie apart, by regions, as that command reports it.

// Vertices that the report treats as one region.
struct ComparedRegion {
  std::string name;  // "all", "skin", "anatomy = 2", "handle chin"
  std::vector<int32_t> vertices;
};

struct RegionDistances {
  std::string name;
  DistanceSummary distances;
};

// "all" and "skin" (the vertices of the boundary) of a mesh.
std::vector<ComparedRegion> WholeAndSkin(const TetMesh& mesh);

// One for each region that is not empty, in their order. REQUIRES: vertices of `distances_mm`, #V.
std::vector<RegionDistances> DistancesByRegion(const Eigen::VectorXd& distances_mm,
                                               const std::vector<ComparedRegion>& regions);

// The point arrays distance_mm and difference_mm (to minus from, three components), replacing
// arrays of these names.
void AddDifferenceArrays(const Positions& from, const Positions& to,
                         std::vector<Attribute>* point_data);

// Text: the headline of a table and a line of it for every region.
void PrintDistanceHeadline();
void PrintDistances(const std::vector<RegionDistances>& regions);

nlohmann::ordered_json DistancesToJson(const DistanceSummary& summary);

// CSV: columns "region", "vertices" and the five figures, after those in `leading`.
CsvTable DistanceTable(std::vector<std::string> leading);
void AddDistanceRows(const std::vector<std::string>& leading,
                     const std::vector<RegionDistances>& regions, CsvTable* table);

}  // namespace tissueform
