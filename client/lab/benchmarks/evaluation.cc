// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/benchmarks/evaluation.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"

#include "client/lab/benchmarks/test_bars.h"

namespace tissueform::benchmarks {
namespace {

constexpr double kGib = 1024.0 * 1024.0 * 1024.0;

std::string NameOf(int bar) {
  const auto& cells = kBars[static_cast<size_t>(bar - 1)];
  return absl::StrCat(cells[0], "x", cells[1], "x", cells[2]);
}

// Collects targets; figures that were not measured are left out.
class TargetList {
 public:
  explicit TargetList(const BenchmarkReport& report)
      : rows_(report.rows), sets_(report.instruction_sets) {}

  void AtMost(const std::string& requirement, std::optional<double> figure, double limit) {
    if (figure) targets_.push_back({requirement, *figure, *figure <= limit});
  }
  void AtLeast(const std::string& requirement, std::optional<double> figure, double limit) {
    if (figure) targets_.push_back({requirement, *figure, *figure >= limit});
  }

  std::optional<double> Ours(absl::string_view work, int bar) const {
    for (const BenchmarkRow& row : rows_) {
      if (row.work == work && row.mesh == NameOf(bar)) return row.ours_seconds;
    }
    return std::nullopt;
  }

  std::optional<double> Bytes(absl::string_view work, int bar) const {
    for (const BenchmarkRow& row : rows_) {
      if (row.work == work && row.mesh == NameOf(bar)) return static_cast<double>(row.bytes);
    }
    return std::nullopt;
  }

  // Peer's seconds over ours.
  std::optional<double> Ratio(absl::string_view work, int bar, absl::string_view peer) const {
    for (const BenchmarkRow& row : rows_) {
      if (row.work == work && row.mesh == NameOf(bar) && row.peer == peer) return row.Ratio();
    }
    return std::nullopt;
  }

  // Of a frame on one instruction set; empty where it was not timed on it.
  std::optional<double> FrameRatio(absl::string_view work, InstructionSet set) const {
    return Ratio(WorkOnSet(std::string(work), set, sets_), kPaperBar, "back-substitution");
  }

  std::vector<Target> Take() { return std::move(targets_); }

 private:
  const std::vector<BenchmarkRow>& rows_;
  const std::vector<InstructionSet>& sets_;
  std::vector<Target> targets_;
};

std::optional<double> Inverse(std::optional<double> value) {
  return value ? std::optional<double>(1 / *value) : std::nullopt;
}

std::optional<double> Quotient(std::optional<double> a, std::optional<double> b) {
  return a && b ? std::optional<double>(*a / *b) : std::nullopt;
}

std::optional<double> MostSolves(const std::vector<BenchmarkRow>& rows) {
  int most = 0;
  for (const BenchmarkRow& row : rows) {
    most = std::max(most, row.solves);
  }
  return most > 0 ? std::optional<double>(most) : std::nullopt;
}

void AddTimes(int bar, TargetList* list) {
  const std::string on = absl::StrCat(" on ", NameOf(bar));
  list->AtMost(absl::StrCat("analyze + factorize / direct CHOLMOD <= 1.15", on),
               Inverse(list->Ratio("analyze + factorize", bar, "CHOLMOD")), 1.15);
  list->AtMost(absl::StrCat("solve 3 / direct CHOLMOD <= 1.15", on),
               Inverse(list->Ratio("solve 3", bar, "CHOLMOD")), 1.15);
  list->AtMost(absl::StrCat("assemble / factorize <= 0.25", on),
               Quotient(list->Ours("assemble", bar), list->Ours("factorize", bar)), 0.25);
  list->AtMost(absl::StrCat("local step / solve 3 <= 0.5", on),
               Quotient(list->Ours("local step", bar), list->Ours("solve 3", bar)), 0.5);
  list->AtLeast(absl::StrCat("SimplicialLDLT / ours, analyze + factorize >= 8", on),
                list->Ratio("analyze + factorize", bar, "Eigen SimplicialLDLT"), 8);
  list->AtLeast(absl::StrCat("SimplicialLDLT / ours, solve 3 >= 2", on),
                list->Ratio("solve 3", bar, "Eigen SimplicialLDLT"), 2);
}

// Frames from prepared answers.
void AddFrames(TargetList* list) {
  const std::string on = absl::StrCat(" on ", NameOf(kPaperBar));
  for (const auto& [work, times] :
       {std::pair("basis frame", 900.0), std::pair("basis frame, 3 handles", 200.0),
        std::pair("elastic frame", 100.0)}) {
    list->AtLeast(absl::StrCat("back-substitution / ", work, " >= ", times, on),
                  list->Ratio(work, kPaperBar, "back-substitution"), times);
  }
  for (const auto& [work, times] :
       {std::pair("basis frame", 500.0), std::pair("basis frame, 3 handles", 120.0)}) {
    list->AtLeast(absl::StrCat("back-substitution / ", work, " on avx2 >= ", times, on),
                  list->FrameRatio(work, InstructionSet::kAvx2), times);
  }
  for (const auto& [handles, times] : {std::pair("", 3.0), std::pair(", 3 handles", 4.0)}) {
    list->AtMost(absl::StrCat("basis preparation", handles, " / factorize <= ", times, on),
                 Quotient(list->Ours(absl::StrCat("basis preparation", handles), kPaperBar),
                          list->Ours("factorize", kPaperBar)),
                 times);
  }
  for (const char* handles : {"", ", 3 handles"}) {
    const std::optional<double> share =
        Quotient(list->Bytes(absl::StrCat("basis frame", handles), kPaperBar),
                 list->Bytes(absl::StrCat("basis preparation", handles), kPaperBar));
    list->AtMost(absl::StrCat("bytes held / asked for to make them <= 1", handles, on), share, 1);
  }
  list->AtLeast(absl::StrCat("frames a second >= 60 on ", NameOf(kLargeBar)),
                Inverse(list->Ours("basis frame", kLargeBar)), 60);
}

// Whole programs.
void AddProcesses(const std::vector<BenchmarkRow>& rows, TargetList* list) {
  for (const BenchmarkRow& row : rows) {
    if (row.peer == "ccx") {
      list->AtLeast(absl::StrCat("ccx / ours, ", row.work, " >= 10 on ", row.mesh), row.Ratio(),
                    10);
    }
  }
}

void AddMemory(const MemoryUse& use, TargetList* list) {
  // A process that has done nothing yet has its code and libraries in memory; these are no
  // session's.
  const auto of_the_work = static_cast<double>(use.peak_bytes - use.baseline_bytes);
  list->AtMost(
      absl::StrCat("peak memory beyond the bare process / (factor + mesh + matrix) <= 1.5 on ",
                   use.mesh),
      of_the_work / static_cast<double>(use.NeededBytes()), 1.5);
  if (use.bar == kLargeBar) {
    list->AtMost(absl::StrCat("peak memory in GiB <= 24 on ", use.mesh),
                 static_cast<double>(use.peak_bytes) / kGib, 24);
  }
}

}  // namespace

std::vector<Growth> GrowthExponents(const std::vector<BenchmarkRow>& rows) {
  // log seconds by log tets, or by log of the answered vertices; one entry per mesh, for any number
  // of peers.
  std::vector<std::string> works;
  std::map<std::string, std::map<double, double>> points;
  for (const BenchmarkRow& row : rows) {
    if (points.find(row.work) == points.end()) works.push_back(row.work);
    const int64_t size = row.answer_vertices > 0 ? row.answer_vertices : row.tets;
    points[row.work][std::log(static_cast<double>(size))] = std::log(row.ours_seconds);
  }
  std::vector<Growth> growth;
  for (const std::string& work : works) {
    double n = 0, x_sum = 0, y_sum = 0, xx_sum = 0, xy_sum = 0;
    for (const auto& [x, y] : points[work]) {
      n += 1;
      x_sum += x;
      y_sum += y;
      xx_sum += x * x;
      xy_sum += x * y;
    }
    if (n >= 2) {
      growth.push_back({work, (n * xy_sum - x_sum * y_sum) / (n * xx_sum - x_sum * x_sum)});
    }
  }
  return growth;
}

std::vector<Target> EvaluateTargets(const BenchmarkReport& report) {
  TargetList list(report);
  AddTimes(kPaperBar, &list);
  AddTimes(kLargeBar, &list);
  AddFrames(&list);
  AddProcesses(report.rows, &list);
  list.AtMost("solves of an estimated answer <= 10, most of all bars", MostSolves(report.rows), 10);
  for (const MemoryUse& use : report.memory) {
    if (use.bar >= kPaperBar) AddMemory(use, &list);
  }
  return list.Take();
}

}  // namespace tissueform::benchmarks
