// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/compare_command.h"

#include <cmath>
#include <iostream>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "nlohmann/json.hpp"

#include "client/cli/option_checks.h"
#include "core/base/atomic_file.h"
#include "core/base/status_macros.h"
#include "core/deformation/comparison.h"
#include "core/mesh_io/tet_mesh_io.h"
#include "core/planning/array_lookup.h"

namespace tissueform {
namespace {

using OrderedJson = nlohmann::ordered_json;

constexpr char kDistanceArray[] = "distance_mm";

struct CompareOptions {
  std::string a;
  std::string b;
  std::string by;
  std::string out;
  bool json = false;
};

struct Comparison {
  DistanceSummary overall;
  std::map<int64_t, DistanceSummary> by_region;
};

absl::StatusOr<TetMeshFile> ReadFiniteMesh(const std::string& path) {
  TF_ASSIGN_OR_RETURN(TetMeshFile file, ReadTetMesh(path));
  if (file.mesh.positions().allFinite()) return file;
  return absl::InvalidArgumentError(absl::StrCat(
      "mesh ", path, " has coordinates that are not finite; see tissueform mesh check"));
}

absl::StatusOr<std::vector<int64_t>> ReadLabels(const TetMeshFile& file,
                                                const CompareOptions& options) {
  TF_ASSIGN_OR_RETURN(const std::vector<double> values,
                      FindScalars(file.point_data, options.by, "point"));
  std::vector<int64_t> labels;
  for (const double value : values) {
    if (value != std::floor(value) || std::abs(value) > 1e15) {
      return absl::InvalidArgumentError(absl::StrCat("point array \"", options.by, "\" of ",
                                                     options.a, " holds ", value,
                                                     "; labels are whole numbers"));
    }
    labels.push_back(static_cast<int64_t>(value));
  }
  return labels;
}

OrderedJson SummaryToJson(const DistanceSummary& summary) {
  return {{"vertices", summary.count}, {"mean_mm", summary.mean_mm}, {"p50_mm", summary.p50_mm},
          {"p90_mm", summary.p90_mm},  {"p95_mm", summary.p95_mm},   {"max_mm", summary.max_mm}};
}

void PrintJson(const CompareOptions& options, const Comparison& comparison) {
  OrderedJson json = {
      {"a", options.a}, {"b", options.b}, {"overall", SummaryToJson(comparison.overall)}};
  if (!options.by.empty()) {
    json["by"] = options.by;
    json["regions"] = OrderedJson::object();
    for (const auto& [label, summary] : comparison.by_region) {
      json["regions"][absl::StrCat(label)] = SummaryToJson(summary);
    }
  }
  std::cout << json.dump(2, ' ', false, OrderedJson::error_handler_t::replace) << '\n';
}

void PrintRow(const std::string& name, const DistanceSummary& s) {
  absl::PrintF("%-16s %9d %12.6g %12.6g %12.6g %12.6g %12.6g\n", name, s.count, s.mean_mm, s.p50_mm,
               s.p90_mm, s.p95_mm, s.max_mm);
}

void PrintTable(const CompareOptions& options, const Comparison& comparison) {
  absl::PrintF("distance in mm between vertices of %s and %s\n", options.a, options.b);
  absl::PrintF("%-16s %9s %12s %12s %12s %12s %12s\n", "region", "vertices", "mean", "p50", "p90",
               "p95", "max");
  PrintRow("all", comparison.overall);
  for (const auto& [label, summary] : comparison.by_region) {
    PrintRow(absl::StrCat(options.by, " = ", label), summary);
  }
}

absl::Status WriteDifference(const std::string& path, TetMeshFile a,
                             std::vector<double> distances) {
  std::erase_if(a.point_data, [](const Attribute& array) { return array.name == kDistanceArray; });
  a.point_data.push_back({kDistanceArray, 1, std::move(distances)});
  return WriteTetMesh(path, a);
}

absl::Status RunCompare(const CompareOptions& options) {
  if (!options.out.empty()) TF_RETURN_IF_ERROR(CheckWritable(options.out));
  TF_ASSIGN_OR_RETURN(TetMeshFile a, ReadFiniteMesh(options.a));
  TF_ASSIGN_OR_RETURN(const TetMeshFile b, ReadFiniteMesh(options.b));
  TF_ASSIGN_OR_RETURN(const Eigen::VectorXd distances,
                      VertexDistances(a.mesh.positions(), b.mesh.positions()));
  const std::vector<double> values(distances.begin(), distances.end());
  Comparison comparison{SummarizeDistances(values), {}};
  if (!options.by.empty()) {
    TF_ASSIGN_OR_RETURN(const std::vector<int64_t> labels, ReadLabels(a, options));
    comparison.by_region = SummarizeDistancesByRegion(distances, labels);
  }
  if (!options.out.empty()) TF_RETURN_IF_ERROR(WriteDifference(options.out, std::move(a), values));
  options.json ? PrintJson(options, comparison) : PrintTable(options, comparison);
  return absl::OkStatus();
}

}  // namespace

void AddCompareCommand(CLI::App& app, CommandWork* work) {
  auto options = std::make_shared<CompareOptions>();
  CLI::App* command =
      app.add_subcommand("compare", "how far two results lie apart, vertex by vertex, in mm");
  command->add_option("A", options->a, "a result (.vtu)")->required();
  command->add_option("B", options->b, "another one with the same vertices")->required();
  command->add_option("--by", options->by, "also for each value of this point array of A");
  command->add_option("--out", options->out, "write A with point array distance_mm")
      ->check(VtuEnding());
  command->add_flag("--json", options->json, "print the figures as JSON");
  command->footer(
      "Examples:\n"
      "  tissueform compare predicted.vtu reference.vtu\n"
      "  tissueform compare predicted.vtu reference.vtu --by anatomy --out difference.vtu\n"
      "Percentiles are nearest-rank.");
  command->callback([options, work] { *work = [options] { return RunCompare(*options); }; });
}

}  // namespace tissueform
