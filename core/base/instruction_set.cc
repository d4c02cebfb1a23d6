// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/instruction_set.h"

#include <atomic>

namespace tissueform {
namespace {

// A function's static, because kernels may run while other files' statics are initialized.
std::atomic<InstructionSet>& Active() {
  static std::atomic<InstructionSet> active{SupportedInstructionSets().front()};
  return active;
}

}  // namespace

const char* InstructionSetName(InstructionSet set) {
  if (set == InstructionSet::kAvx512) return "avx512";
  return set == InstructionSet::kAvx2 ? "avx2" : "baseline";
}

std::vector<std::string> InstructionSetNames(const std::vector<InstructionSet>& sets) {
  std::vector<std::string> names;
  names.reserve(sets.size());
  for (const InstructionSet set : sets) names.emplace_back(InstructionSetName(set));
  return names;
}

std::vector<InstructionSet> SupportedInstructionSets() {
  std::vector<InstructionSet> sets;
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl")) {
    sets.push_back(InstructionSet::kAvx512);
  }
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) {
    sets.push_back(InstructionSet::kAvx2);
  }
#endif
  sets.push_back(InstructionSet::kBaseline);
  return sets;
}

InstructionSet ActiveInstructionSet() { return Active().load(std::memory_order_relaxed); }

ScopedInstructionSet::ScopedInstructionSet(InstructionSet set) : previous_(ActiveInstructionSet()) {
  Active().store(set, std::memory_order_relaxed);
}

ScopedInstructionSet::~ScopedInstructionSet() {
  Active().store(previous_, std::memory_order_relaxed);
}

}  // namespace tissueform
