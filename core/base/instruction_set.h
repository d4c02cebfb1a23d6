// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

// Hot loops are compiled once for each of these instruction sets, from one body that is inlined
// into three functions:
//
//   void ScaleBaseline(...) { ScaleBody<RegisterBytes(InstructionSet::kBaseline)>(...); }
//   TISSUEFORM_TARGET_AVX2 void ScaleAvx2(...) { ... }
//   TISSUEFORM_TARGET_AVX512 void ScaleAvx512(...) { ... }
//   constexpr KernelVersions<void(...)> kScale{ScaleBaseline, ScaleAvx2, ScaleAvx512};
//   kScale.Active()(...);
//
// They are plain attributes because the resolvers of target_clones run before the sanitizers are
// set up. On processors other than x86-64 they are empty and the baseline version runs.
#if defined(__x86_64__)
#define TISSUEFORM_TARGET_AVX2 __attribute__((target("avx2,fma")))
#define TISSUEFORM_TARGET_AVX512 __attribute__((target("avx512f,avx512dq,avx512vl")))
#else
#define TISSUEFORM_TARGET_AVX2
#define TISSUEFORM_TARGET_AVX512
#endif

namespace tissueform {

enum class InstructionSet { kBaseline, kAvx2, kAvx512 };

// Bytes of a vector register. A kernel's vector types must be exactly this wide: GCC 12 moves wider
// ones through memory, which makes a product 20 times slower.
constexpr int RegisterBytes(InstructionSet set) {
  if (set == InstructionSet::kAvx512) return 64;
  return set == InstructionSet::kAvx2 ? 32 : 16;
}

// "baseline", "avx2" or "avx512".
const char* InstructionSetName(InstructionSet set);
std::vector<std::string> InstructionSetNames(const std::vector<InstructionSet>& sets);

// Those that this processor has, the widest first. The last one is always kBaseline.
std::vector<InstructionSet> SupportedInstructionSets();

// The one that kernels use now: the widest supported one, except during a ScopedInstructionSet.
// Callable from any thread.
InstructionSet ActiveInstructionSet();

// Makes all kernels of the process use another instruction set until it is destroyed: for
// benchmarks and tests. REQUIRES: `set` is supported; objects are destroyed in reverse order.
class ScopedInstructionSet {
 public:
  explicit ScopedInstructionSet(InstructionSet set);
  ~ScopedInstructionSet();
  ScopedInstructionSet(const ScopedInstructionSet&) = delete;
  ScopedInstructionSet& operator=(const ScopedInstructionSet&) = delete;

 private:
  InstructionSet previous_;
};

// One function, compiled for each instruction set.
template <typename Function>
struct KernelVersions {
  Function* baseline;
  Function* avx2;
  Function* avx512;

  Function* Active() const {
#if defined(__x86_64__)
    const InstructionSet set = ActiveInstructionSet();
    if (set == InstructionSet::kAvx512) return avx512;
    return set == InstructionSet::kAvx2 ? avx2 : baseline;
#else
    return baseline;  // the others are not even linked: a page stays small
#endif
  }
};

}  // namespace tissueform
