// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/compare/comparison_report.h"

#include <numeric>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "core/mesh/tet_topology.h"

namespace tissueform {
namespace {

using OrderedJson = nlohmann::ordered_json;

constexpr char kDistanceArray[] = "distance_mm";
constexpr char kDifferenceArray[] = "difference_mm";

std::vector<double> Values(const Positions& rows) {
  return {rows.data(), rows.data() + rows.size()};
}

}  // namespace

std::vector<ComparedRegion> WholeAndSkin(const TetMesh& mesh) {
  std::vector<int32_t> all(static_cast<size_t>(mesh.num_vertices()));
  std::iota(all.begin(), all.end(), 0);
  return {{"all", std::move(all)}, {"skin", BoundaryVertices(mesh)}};
}

std::vector<RegionDistances> DistancesByRegion(const Eigen::VectorXd& distances_mm,
                                               const std::vector<ComparedRegion>& regions) {
  std::vector<RegionDistances> result;
  for (const ComparedRegion& region : regions) {
    if (region.vertices.empty()) continue;
    const Eigen::VectorXd of_region = distances_mm(region.vertices);
    result.push_back({region.name, SummarizeDistances({of_region.begin(), of_region.end()})});
  }
  return result;
}

void AddDifferenceArrays(const Positions& from, const Positions& to,
                         std::vector<Attribute>* point_data) {
  std::erase_if(*point_data, [](const Attribute& array) {
    return array.name == kDistanceArray || array.name == kDifferenceArray;
  });
  const Positions difference = to - from;
  const Eigen::VectorXd distance = difference.rowwise().norm();
  point_data->push_back({kDistanceArray, 1, std::vector<double>(distance.begin(), distance.end())});
  point_data->push_back({kDifferenceArray, 3, Values(difference)});
}

void PrintDistanceHeadline() {
  absl::PrintF("%-16s %9s %12s %12s %12s %12s %12s\n", "region", "vertices", "mean", "p50", "p90",
               "p95", "max");
}

void PrintDistances(const std::vector<RegionDistances>& regions) {
  for (const auto& [name, s] : regions) {
    absl::PrintF("%-16s %9d %12.6g %12.6g %12.6g %12.6g %12.6g\n", name, s.count, s.mean_mm,
                 s.p50_mm, s.p90_mm, s.p95_mm, s.max_mm);
  }
}

OrderedJson DistancesToJson(const DistanceSummary& summary) {
  return {{"vertices", summary.count}, {"mean_mm", summary.mean_mm}, {"p50_mm", summary.p50_mm},
          {"p90_mm", summary.p90_mm},  {"p95_mm", summary.p95_mm},   {"max_mm", summary.max_mm}};
}

CsvTable DistanceTable(std::vector<std::string> leading) {
  leading.insert(leading.end(),
                 {"region", "vertices", "mean_mm", "p50_mm", "p90_mm", "p95_mm", "max_mm"});
  return CsvTable(std::move(leading));
}

void AddDistanceRows(const std::vector<std::string>& leading,
                     const std::vector<RegionDistances>& regions, CsvTable* table) {
  for (const auto& [name, s] : regions) {
    std::vector<std::string> cells = leading;
    cells.insert(cells.end(), {name, absl::StrCat(s.count), Cell(s.mean_mm), Cell(s.p50_mm),
                               Cell(s.p90_mm), Cell(s.p95_mm), Cell(s.max_mm)});
    table->AddRow(std::move(cells));
  }
}

}  // namespace tissueform
