// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/benchmarks/benchmark_report.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "nlohmann/json.hpp"

#include "client/cli/shared/circumstances.h"

namespace tissueform::benchmarks {
namespace {

using Json = nlohmann::ordered_json;

Json OrNull(const std::optional<double>& value) { return value ? Json(*value) : Json(); }

Json RowJson(const BenchmarkRow& row) {
  Json json = {{"work", row.work},
               {"mesh", row.mesh},
               {"vertices", row.vertices},
               {"tets", row.tets},
               {"ours_seconds", row.ours_seconds},
               {"peer", row.peer},
               {"peer_seconds", OrNull(row.peer_seconds)},
               {"ratio", OrNull(row.Ratio())},
               {"bytes", row.bytes}};
  if (row.solves > 0) {
    json["solves"] = row.solves;
  }
  return json;
}

Json MemoryJson(const MemoryUse& memory) {
  return {{"mesh", memory.mesh},
          {"baseline_bytes", memory.baseline_bytes},
          {"peak_bytes", memory.peak_bytes},
          {"factor_bytes", memory.factor_bytes},
          {"mesh_bytes", memory.mesh_bytes},
          {"matrix_bytes", memory.matrix_bytes}};
}

std::string OrDash(const std::optional<double>& value, int digits) {
  return value ? absl::StrFormat("%.*f", digits, *value) : "-";
}

double Mib(int64_t bytes) { return static_cast<double>(bytes) / (1024.0 * 1024.0); }

}  // namespace

std::optional<double> BenchmarkRow::Ratio() const {
  return peer_seconds ? std::optional<double>(*peer_seconds / ours_seconds) : std::nullopt;
}

std::string WorkOnSet(const std::string& work, InstructionSet set,
                      const std::vector<InstructionSet>& sets) {
  return set == sets.front() ? work : absl::StrCat(work, " [", InstructionSetName(set), "]");
}

std::string ReportJson(const BenchmarkReport& report) {
  const Circumstances circumstances = MeasuringCircumstances();
  Json json = {{"machine", circumstances.machine},
               {"compiler", circumstances.compiler},
               {"commit", circumstances.commit},
               {"threads", report.threads},
               {"instruction_sets", InstructionSetNames(report.instruction_sets)},
               {"blas_threads", 1},
               {"repetitions", report.repetitions},
               {"rows", Json::array()},
               {"memory", Json::array()},
               {"growth", Json::object()},
               {"targets", Json::array()}};
  for (const BenchmarkRow& row : report.rows) {
    json["rows"].push_back(RowJson(row));
  }
  for (const MemoryUse& memory : report.memory) {
    json["memory"].push_back(MemoryJson(memory));
  }
  for (const Growth& growth : report.growth) {
    json["growth"][growth.work] = growth.exponent;
  }
  for (const Target& target : report.targets) {
    json["targets"].push_back({{"requirement", target.requirement},
                               {"figure", target.figure},
                               {"reached", target.reached}});
  }
  return json.dump(2) + "\n";
}

std::string RowsHeading() {
  return absl::StrFormat("%-33s %-10s %8s %9s %11s  %-22s %11s %7s %8s", "work", "mesh", "vertices",
                         "tets", "ours [s]", "peer", "peer [s]", "ratio", "MiB");
}

std::string RowText(const BenchmarkRow& row) {
  const std::string solves = row.solves > 0 ? absl::StrCat("  ", row.solves, " solves") : "";
  const std::string mib = row.bytes > 0 ? absl::StrFormat("%.1f", Mib(row.bytes)) : "-";
  return absl::StrFormat("%-33s %-10s %8d %9d %11.7f  %-22s %11s %7s %8s%s", row.work, row.mesh,
                         row.vertices, row.tets, row.ours_seconds, row.peer,
                         OrDash(row.peer_seconds, 6), OrDash(row.Ratio(), 2), mib, solves);
}

std::string MemoryText(const MemoryUse& memory) {
  return absl::StrFormat(
      "peak memory of a process of its own on %s: %.1f MiB (%.1f before it began); factor %.1f + "
      "mesh %.1f + matrix %.1f",
      memory.mesh, Mib(memory.peak_bytes), Mib(memory.baseline_bytes), Mib(memory.factor_bytes),
      Mib(memory.mesh_bytes), Mib(memory.matrix_bytes));
}

std::string ClosingText(const BenchmarkReport& report) {
  std::string text;
  if (!report.growth.empty()) {
    absl::StrAppend(&text,
                    "\ngrowth: seconds ~ tets^exponent; frames: vertices of the answer^exponent\n");
  }
  for (const Growth& growth : report.growth) {
    absl::StrAppend(&text, absl::StrFormat("  %-33s %5.2f\n", growth.work, growth.exponent));
  }
  if (!report.targets.empty()) {
    absl::StrAppend(&text, "\ntargets\n");
  }
  for (const Target& target : report.targets) {
    absl::StrAppend(&text, absl::StrFormat("  %-72s %8.3f  %s\n", target.requirement, target.figure,
                                           target.reached ? "reached" : "missed"));
  }
  return text;
}

std::string CircumstancesText(const BenchmarkReport& report) {
  const Circumstances circumstances = MeasuringCircumstances();
  return absl::StrCat(
      circumstances.machine, "; ", circumstances.compiler, "; commit ", circumstances.commit, "; ",
      absl::StrJoin(InstructionSetNames(report.instruction_sets), ", "), "; ", report.threads,
      " threads, 1 BLAS thread; medians of ", report.repetitions, " interleaved repetitions");
}

}  // namespace tissueform::benchmarks
