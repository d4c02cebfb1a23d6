// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/stiffness_table.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "absl/strings/str_cat.h"

namespace tissueform {
namespace {

constexpr double kNoLimit = std::numeric_limits<double>::infinity();

constexpr char kHuSource[] = "HU limits: Mitsiopoulos et al. 1998, J Appl Physiol 85:115";
constexpr char kModulusSource[] = "in vivo, 28 subjects, doi 10.1007/s10439-024-03581-2";

std::string Source(const char* place) {
  return absl::StrCat(kHuSource, "; modulus: ", place, ", ", kModulusSource);
}

}  // namespace

StiffnessTable DefaultStiffnessTable() {
  return {{"fat", -30, 16e3, Source("cheek 16 +- 5 kPa"), 1.8},
          {"muscle", 150, 27e3, Source("below the cheekbone 27 +- 11 kPa"), 2.2},
          {"dense", kNoLimit, 53e3, Source("chin 53 +- 21 kPa"), 2.1}};
}

absl::Status CheckStiffnessTable(const StiffnessTable& table) {
  if (table.empty()) return absl::InvalidArgumentError("the stiffness table is empty");
  if (table.front().factor_95 != 0 && table.size() > kMaxTissuesWithFactors) {
    return absl::InvalidArgumentError(absl::StrCat(
        "stiffness table: ", table.size(), " tissues have \"youngs_modulus_factor_95\"; at most ",
        kMaxTissuesWithFactors, " may, so leave it out of all or take fewer tissues"));
  }
  double last = -kNoLimit;
  for (const TissueClass& tissue : table) {
    if (!(tissue.hu_below > last)) {
      return absl::InvalidArgumentError(
          absl::StrCat("stiffness table: \"hu_below\" of tissue \"", tissue.name,
                       "\" must be larger than that of the one before"));
    }
    if (!(tissue.youngs_modulus_pa > 0 && std::isfinite(tissue.youngs_modulus_pa))) {
      return absl::InvalidArgumentError(
          absl::StrCat("stiffness table: \"youngs_modulus_pa\" of tissue \"", tissue.name,
                       "\" must be positive, not ", tissue.youngs_modulus_pa));
    }
    if ((tissue.factor_95 == 0) != (table.front().factor_95 == 0)) {
      return absl::InvalidArgumentError(
          absl::StrCat("stiffness table: give \"youngs_modulus_factor_95\" to every tissue or to "
                       "none; \"",
                       tissue.name, "\" differs from \"", table.front().name, "\""));
    }
    last = tissue.hu_below;
  }
  if (last != kNoLimit) {
    return absl::InvalidArgumentError(absl::StrCat("stiffness table: the last tissue, \"",
                                                   table.back().name,
                                                   "\", must have no \"hu_below\""));
  }
  return absl::OkStatus();
}

int TissueOf(const StiffnessTable& table, double hu) {
  const auto tissue = std::find_if(table.begin(), table.end() - 1,
                                   [hu](const TissueClass& t) { return hu < t.hu_below; });
  return static_cast<int>(tissue - table.begin());
}

}  // namespace tissueform
