// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "proto/conversion/material_conversion.h"

#include <bit>
#include <cstring>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

// Little-endian, as every machine that this runs on.
static_assert(std::endian::native == std::endian::little);

absl::Status CheckFactors(const v1::MaterialRanges& proto) {
  if (proto.factors_95().empty() || proto.factors_95_size() > kMaxTissues) {
    return absl::InvalidArgumentError(absl::StrCat("ranges.factors_95 has ",
                                                   proto.factors_95_size(),
                                                   " entries; it must be 1 to ", kMaxTissues));
  }
  for (const double factor : proto.factors_95()) {
    if (!(factor >= 1 && factor <= kLargestFactor95)) {
      return absl::InvalidArgumentError(absl::StrCat("ranges.factors_95 holds ", factor,
                                                     "; a factor must be 1 to ", kLargestFactor95));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckPoissonRatios(const v1::MaterialRanges& proto, double poisson_ratio) {
  if (!proto.has_lowest_poisson_ratio() && !proto.has_highest_poisson_ratio()) {
    return absl::OkStatus();
  }
  const double lowest = proto.lowest_poisson_ratio();
  const double highest = proto.highest_poisson_ratio();
  if (proto.has_lowest_poisson_ratio() && proto.has_highest_poisson_ratio() && lowest >= 0 &&
      lowest < highest && highest <= kLargestUncertainPoissonRatio && lowest <= poisson_ratio &&
      poisson_ratio <= highest) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrCat("ranges.lowest_poisson_ratio and highest_poisson_ratio, ", lowest, " and ",
                   highest, ", must both be given, rise from 0 to ", kLargestUncertainPoissonRatio,
                   " and hold the session's, which is ", poisson_ratio));
}

}  // namespace

v1::MaterialRanges ToProto(const MaterialUncertainty& uncertainty) {
  v1::MaterialRanges proto;
  proto.mutable_tissues()->assign(uncertainty.tissue_of_tet.begin(),
                                  uncertainty.tissue_of_tet.end());
  for (const MaterialUncertainty::Tissue& tissue : uncertainty.tissues) {
    proto.add_factors_95(tissue.factor_95);
  }
  if (const auto& range = uncertainty.poisson_ratio_95) {
    proto.set_lowest_poisson_ratio((*range)[0]);
    proto.set_highest_poisson_ratio((*range)[1]);
  }
  return proto;
}

absl::StatusOr<MaterialUncertainty> ToMaterialUncertainty(const v1::MaterialRanges& proto,
                                                          Eigen::Index num_tets,
                                                          double poisson_ratio) {
  TF_RETURN_IF_ERROR(CheckFactors(proto));
  TF_RETURN_IF_ERROR(CheckPoissonRatios(proto, poisson_ratio));
  if (static_cast<Eigen::Index>(proto.tissues().size()) != num_tets) {
    return absl::InvalidArgumentError(absl::StrCat("ranges.tissues has ", proto.tissues().size(),
                                                   " bytes; it must be one per tet, ", num_tets));
  }
  MaterialUncertainty uncertainty;
  for (const double factor : proto.factors_95()) uncertainty.tissues.push_back({"", factor});
  for (const char byte : proto.tissues()) {
    const auto tissue = static_cast<unsigned char>(byte);
    if (tissue >= uncertainty.tissues.size()) {
      return absl::InvalidArgumentError(absl::StrCat(
          "ranges.tissues gives tet ", uncertainty.tissue_of_tet.size(), " the tissue ", tissue,
          ", but there are ", uncertainty.tissues.size(), " factors"));
    }
    uncertainty.tissue_of_tet.push_back(tissue);
  }
  if (proto.has_lowest_poisson_ratio()) {
    uncertainty.poisson_ratio_95 = {proto.lowest_poisson_ratio(), proto.highest_poisson_ratio()};
  }
  return uncertainty;
}

std::string FloatBytes(const Eigen::VectorXf& values) {
  std::string bytes(static_cast<size_t>(values.size()) * sizeof(float), '\0');
  if (!bytes.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

absl::StatusOr<Eigen::VectorXf> FloatsFromBytes(const std::string& bytes, Eigen::Index count) {
  if (bytes.size() != static_cast<size_t>(count) * sizeof(float)) {
    return absl::InvalidArgumentError(absl::StrCat("uncertainty_p95_mm has ", bytes.size(),
                                                   " bytes; it must be four per vertex, ",
                                                   4 * count));
  }
  Eigen::VectorXf values(count);
  if (count > 0) std::memcpy(values.data(), bytes.data(), bytes.size());
  return values;
}

}  // namespace tissueform
