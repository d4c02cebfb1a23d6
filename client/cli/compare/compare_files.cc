// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/compare/compare_files.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "client/cli/shared/report_parts.h"
#include "client/cli/shared/uncertainty_results.h"
#include "core/base/atomic_file.h"
#include "core/base/status_macros.h"
#include "core/mesh/attribute.h"
#include "core/mesh/io/tet_mesh_io.h"

namespace tissueform {
namespace {

using OrderedJson = nlohmann::ordered_json;

// How many vertices of B lie within what A says of its material's uncertainty.
struct WithinBand {
  int64_t vertices = 0;  // for which A has a band: free ones
  int64_t within = 0;
  double largest_beyond_mm = 0;

  double share() const { return static_cast<double>(within) / static_cast<double>(vertices); }
};

struct FileComparison {
  std::vector<RegionDistances> whole;   // "all", "skin"
  std::vector<RegionDistances> labels;  // named by their value of the point array
  std::optional<WithinBand> within_band;
};

absl::Status CheckOutputs(const CompareOptions& options) {
  if (!options.out.empty()) TF_RETURN_IF_ERROR(CheckWritable(options.out));
  if (!options.csv.empty()) TF_RETURN_IF_ERROR(CheckWritable(options.csv));
  return absl::OkStatus();
}

absl::StatusOr<TetMeshFile> ReadFiniteMesh(const std::string& path) {
  TF_ASSIGN_OR_RETURN(TetMeshFile file, ReadTetMesh(path));
  if (file.mesh.positions().allFinite()) return file;
  return absl::InvalidArgumentError(
      absl::StrCat("mesh ", path, " has non-finite coordinates; see tissueform mesh check"));
}

// One region for each label, in rising order.
absl::StatusOr<std::vector<ComparedRegion>> LabelledRegions(const TetMeshFile& file,
                                                            const CompareOptions& options) {
  TF_ASSIGN_OR_RETURN(const std::vector<double> values,
                      FindScalars(file.point_data, options.by, "point"));
  std::map<int64_t, std::vector<int32_t>> vertices;
  for (size_t v = 0; v < values.size(); ++v) {
    if (values[v] != std::floor(values[v]) || std::abs(values[v]) > 1e15) {
      return absl::InvalidArgumentError(absl::StrCat("point array \"", options.by, "\" of ",
                                                     options.a, " holds ", values[v],
                                                     "; labels are whole numbers"));
    }
    vertices[static_cast<int64_t>(values[v])].push_back(static_cast<int32_t>(v));
  }
  std::vector<ComparedRegion> regions;
  regions.reserve(vertices.size());
  for (auto& [label, of_label] : vertices) {
    regions.push_back({absl::StrCat(label), std::move(of_label)});
  }
  return regions;
}

// Empty where A has no band.
absl::StatusOr<std::optional<WithinBand>> CountWithinBand(const TetMeshFile& a,
                                                          const Eigen::VectorXd& distances) {
  if (FindAttribute(a.point_data, kMaterialUncertaintyArray) == nullptr) return std::nullopt;
  TF_ASSIGN_OR_RETURN(const std::vector<double> band,
                      FindScalars(a.point_data, kMaterialUncertaintyArray, "point"));
  WithinBand count;
  for (size_t v = 0; v < band.size(); ++v) {
    if (!(band[v] > 0)) continue;
    ++count.vertices;
    const double beyond = distances[static_cast<Eigen::Index>(v)] - band[v];
    if (beyond <= 0) ++count.within;
    count.largest_beyond_mm = std::max(count.largest_beyond_mm, beyond);
  }
  if (count.vertices == 0) return std::nullopt;
  return count;
}

// "2" -> "anatomy = 2"
std::vector<RegionDistances> AllRows(const CompareOptions& options,
                                     const FileComparison& comparison) {
  std::vector<RegionDistances> rows = comparison.whole;
  for (const auto& [label, distances] : comparison.labels) {
    rows.push_back({absl::StrCat(options.by, " = ", label), distances});
  }
  return rows;
}

void PrintJson(const CompareOptions& options, const FileComparison& comparison) {
  OrderedJson json = {{"a", options.a}, {"b", options.b}};
  for (const auto& [name, distances] : comparison.whole) {
    json[name == "all" ? "overall" : name] = DistancesToJson(distances);
  }
  if (comparison.within_band) {
    const WithinBand& band = *comparison.within_band;
    json["within_material_uncertainty"] = {{"notice", kMaterialUncertaintyNotice},
                                           {"vertices", band.vertices},
                                           {"within", band.within},
                                           {"share", band.share()},
                                           {"largest_beyond_mm", band.largest_beyond_mm}};
  }
  if (!options.by.empty()) {
    json["by"] = options.by;
    json["regions"] = OrderedJson::object();
    for (const auto& [label, distances] : comparison.labels) {
      json["regions"][label] = DistancesToJson(distances);
    }
  }
  PrintJsonReport(json);
}

absl::Status Report(const CompareOptions& options, const FileComparison& comparison) {
  const std::vector<RegionDistances> rows = AllRows(options, comparison);
  if (!options.csv.empty()) {
    CsvTable table = DistanceTable({});
    AddDistanceRows({}, rows, &table);
    TF_RETURN_IF_ERROR(table.WriteCsv(options.csv));
  }
  if (options.json) {
    PrintJson(options, comparison);
  } else {
    absl::PrintF("distance in mm between vertices of %s and %s\n", options.a, options.b);
    PrintDistanceHeadline();
    PrintDistances(rows);
    if (comparison.within_band) {
      const WithinBand& band = *comparison.within_band;
      absl::PrintF(
          "B is within A's material uncertainty (%s) at %.1f %% of the %d free vertices, "
          "elsewhere up to %.3g mm beyond\n",
          kMaterialUncertaintyNotice, 100 * band.share(), band.vertices, band.largest_beyond_mm);
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CompareFiles(const CompareOptions& options) {
  TF_RETURN_IF_ERROR(CheckOutputs(options));
  TF_ASSIGN_OR_RETURN(TetMeshFile a, ReadFiniteMesh(options.a));
  TF_ASSIGN_OR_RETURN(const TetMeshFile b, ReadFiniteMesh(options.b));
  TF_ASSIGN_OR_RETURN(const Eigen::VectorXd distances,
                      VertexDistances(a.mesh.positions(), b.mesh.positions()));
  FileComparison comparison{DistancesByRegion(distances, WholeAndSkin(a.mesh)), {}, {}};
  TF_ASSIGN_OR_RETURN(comparison.within_band, CountWithinBand(a, distances));
  if (!options.by.empty()) {
    TF_ASSIGN_OR_RETURN(const std::vector<ComparedRegion> labels, LabelledRegions(a, options));
    comparison.labels = DistancesByRegion(distances, labels);
  }
  if (!options.out.empty()) {
    AddDifferenceArrays(a.mesh.positions(), b.mesh.positions(), &a.point_data);
    TF_RETURN_IF_ERROR(WriteTetMesh(options.out, a));
  }
  return Report(options, comparison);
}

}  // namespace tissueform
