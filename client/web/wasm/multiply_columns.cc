// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <wasm_simd128.h>

// The product of columns that client/web/src/evaluation/column_kernel.ts describes. Without any
// library: deploy/build_web.sh compiles it for browsers, with clang and wasm-ld. Arrays lie where
// JavaScript has put them; rows are a multiple of 16, of which so many vectors of four are added up
// at a time that sums stay in registers.
namespace {

template <int kWidth, int kVectors>
void Multiply(const float* columns, int rows, int count, const float* factors, float* sums) {
  for (int row = 0; row < rows; row += 4 * kVectors) {
    v128_t total[kWidth][kVectors];
    for (auto& of_factor : total) {
      for (v128_t& sum : of_factor) sum = wasm_f32x4_const_splat(0);
    }
    const float* entry = columns + row;
    for (int c = 0; c < count; ++c, entry += rows) {
      for (int f = 0; f < kWidth; ++f) {
        const v128_t factor = wasm_v128_load32_splat(factors + f * count + c);
        for (int i = 0; i < kVectors; ++i) {
          const v128_t product = wasm_f32x4_mul(wasm_v128_load(entry + 4 * i), factor);
          total[f][i] = wasm_f32x4_add(total[f][i], product);
        }
      }
    }
    for (int f = 0; f < kWidth; ++f) {
      for (int i = 0; i < kVectors; ++i) {
        wasm_v128_store(sums + f * rows + row + 4 * i, total[f][i]);
      }
    }
  }
}

}  // namespace

extern "C" {

__attribute__((export_name("multiply1"))) void MultiplyOne(const float* columns, int rows,
                                                           int count, const float* factors,
                                                           float* sums) {
  Multiply<1, 4>(columns, rows, count, factors, sums);
}

__attribute__((export_name("multiply3"))) void MultiplyThree(const float* columns, int rows,
                                                             int count, const float* factors,
                                                             float* sums) {
  Multiply<3, 2>(columns, rows, count, factors, sums);
}

}  // extern "C"
