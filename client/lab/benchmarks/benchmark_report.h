// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/base/instruction_set.h"

namespace tissueform::benchmarks {

// One comparison, as docs/plan-format.md words it for `bench --json`.
struct BenchmarkRow {
  std::string work;
  std::string mesh;
  int64_t vertices = 0;
  int64_t tets = 0;
  double ours_seconds = 0;
  std::string peer = "-";              // no peer
  std::optional<double> peer_seconds;  // empty: no peer, or one that would take too long here
  int64_t bytes = 0;                   // that our side holds for it; 0 where nothing is held
  int64_t answer_vertices = 0;         // that the answer was asked for; 0: all
  int solves = 0;                      // linear solves of an answer that iterates, else 0

  // Above 1: we are faster.
  std::optional<double> Ratio() const;
};

// The process that only prepares and answers; see memory_probe.cc.
struct MemoryUse {
  int bar = 0;
  std::string mesh;
  int64_t baseline_bytes = 0;  // of the process before it does anything
  int64_t peak_bytes = 0;      // baseline included
  int64_t factor_bytes = 0;
  int64_t mesh_bytes = 0;
  int64_t matrix_bytes = 0;

  int64_t NeededBytes() const { return factor_bytes + mesh_bytes + matrix_bytes; }
};

// seconds ~ tets^exponent over the meshes that were measured.
struct Growth {
  std::string work;
  double exponent = 0;
};

struct Target {
  std::string requirement;
  double figure = 0;
  bool reached = false;
};

struct BenchmarkReport {
  int threads = 1;
  // Frames are timed on each of them, everything else on the first, widest one; see WorkOnSet.
  std::vector<InstructionSet> instruction_sets;
  int repetitions = 1;
  std::vector<BenchmarkRow> rows;
  std::vector<MemoryUse> memory;
  std::vector<Growth> growth;
  std::vector<Target> targets;
};

// The work of a row that is timed on each instruction set: `work` itself on the first of them,
// "work [avx2]" on another.
std::string WorkOnSet(const std::string& work, InstructionSet set,
                      const std::vector<InstructionSet>& sets);

// With where it was measured: processor, compiler, commit.
std::string ReportJson(const BenchmarkReport& report);

// For the screen. Rows are printed as they come, so they do not know of each other.
std::string RowsHeading();
std::string RowText(const BenchmarkRow& row);
std::string MemoryText(const MemoryUse& memory);
std::string ClosingText(const BenchmarkReport& report);  // growth and targets

// Machine, compiler, commit, instruction sets, threads and repetitions in one line.
std::string CircumstancesText(const BenchmarkReport& report);

}  // namespace tissueform::benchmarks
