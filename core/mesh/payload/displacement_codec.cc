// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/payload/displacement_codec.h"

#include <bit>
#include <cmath>
#include <memory>

#include "absl/strings/str_cat.h"

#include "zstd.h"

namespace tissueform {
namespace {

static_assert(std::endian::native == std::endian::little, "answers are little-endian");

constexpr int kLargest = 32767;
// Its steps have no reciprocal in single precision soon below.
constexpr double kRestMm = 1e-20;
// Level 3 takes twice as long and saves 2 % of the bytes.
constexpr int kLevel = 1;

struct FreeCompression {
  void operator()(ZSTD_CCtx* context) const { ZSTD_freeCCtx(context); }
};

// A context takes longer to make than a frame takes to pack.
ZSTD_CCtx* ThreadsOwnContext() {
  thread_local const std::unique_ptr<ZSTD_CCtx, FreeCompression> context(ZSTD_createCCtx());
  return context.get();
}

// All x, then all y, then all z: neighbours move alike, so that high bytes repeat.
using Columns = Eigen::Matrix<int16_t, Eigen::Dynamic, 3>;  // column-major

Columns Quantise(const FloatPositions& displacements, double step) {
  const auto steps_per_mm = static_cast<float>(1 / step);
  return (displacements * steps_per_mm).array().rint().cast<int16_t>();
}

absl::Status Damaged(absl::string_view what) {
  return absl::DataLossError(
      absl::StrCat("packed displacements ", what, "; request float32 if this happens again"));
}

absl::Status CheckSize(absl::string_view bytes, size_t expected) {
  const unsigned long long size = ZSTD_getFrameContentSize(bytes.data(), bytes.size());
  if (size == ZSTD_CONTENTSIZE_ERROR || size == ZSTD_CONTENTSIZE_UNKNOWN) {
    return Damaged("are no zstd frame that says its size");
  }
  if (size != expected) {
    return Damaged(absl::StrCat("hold ", size, " bytes in place of ", expected));
  }
  // Nothing behind it.
  const size_t packed = ZSTD_findFrameCompressedSize(bytes.data(), bytes.size());
  if (ZSTD_isError(packed) != 0 || packed != bytes.size()) return Damaged("are not one frame");
  return absl::OkStatus();
}

}  // namespace

CodedDisplacements EncodeDisplacements(const FloatPositions& displacements) {
  CodedDisplacements coded;
  Columns numbers = Columns::Zero(displacements.rows(), 3);
  if (displacements.size() > 0) {
    const double largest = displacements.cwiseAbs().maxCoeff<Eigen::PropagateNaN>();
    coded.step_mm = largest < kRestMm ? 0 : largest / kLargest;
  }
  if (coded.step_mm > 0 && std::isfinite(coded.step_mm)) {
    numbers = Quantise(displacements, coded.step_mm);
  }
  const size_t size = numbers.size() * sizeof(int16_t);
  coded.bytes.resize(ZSTD_compressBound(size));
  const size_t packed = ZSTD_compressCCtx(ThreadsOwnContext(), coded.bytes.data(),
                                          coded.bytes.size(), numbers.data(), size, kLevel);
  coded.bytes.resize(ZSTD_isError(packed) != 0 ? 0 : packed);  // only without memory
  return coded;
}

absl::StatusOr<Positions> DecodeDisplacements(absl::string_view bytes, double step_mm,
                                              int64_t num_vertices) {
  if (!std::isfinite(step_mm) || step_mm < 0) return Damaged("have no finite step");
  if (num_vertices < 0) return Damaged("are of fewer vertices than none");
  const size_t size = static_cast<size_t>(num_vertices) * 3 * sizeof(int16_t);
  if (const absl::Status status = CheckSize(bytes, size); !status.ok()) return status;
  Columns numbers(num_vertices, 3);
  const size_t unpacked = ZSTD_decompress(numbers.data(), size, bytes.data(), bytes.size());
  if (ZSTD_isError(unpacked) != 0 || unpacked != size) return Damaged("are damaged");
  return Positions(numbers.cast<double>() * step_mm);
}

}  // namespace tissueform
