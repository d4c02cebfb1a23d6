// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "absl/status/status.h"

namespace tissueform {

// A kind of soft tissue, distinguished by its CT number.
struct TissueClass {
  std::string name;
  double hu_below = 0;  // its CT numbers end here; they begin where those of the class before end
  double youngs_modulus_pa = 0;
  std::string source;  // of the figures, for the report
  // Young's modulus lies between this part and this multiple of it in 95 of 100 cases; 0: not said.
  double factor_95 = 0;
};

// Most classes of a table with factors: as many ranges as a plan takes (kMaxTissues).
inline constexpr size_t kMaxTissuesWithFactors = 16;

// Classes in ascending order of hu_below; the last one's is infinite.
using StiffnessTable = std::vector<TissueClass>;

// Fat under -30 HU, muscle to 150 HU (the limits that body composition from CT goes by), and what
// is denser. Moduli are effective ones, measured in vivo on 28 faces at places where the tissue
// prevails (doi 10.1007/s10439-024-03581-2): fat 16 kPa (cheek, 16 +- 5), muscle 27 kPa (below the
// cheekbone, 27 +- 11), dense 53 kPa (chin, 53 +- 21). Their spreads give factor_95: that of a
// log-normal variable, exp(1.96 sqrt(ln(1 + (s / m)^2))). Which place stands for which tissue is
// our reading, not that study's; published values for skin alone run from 5 kPa to 140 MPa. A
// recipe may say otherwise.
StiffnessTable DefaultStiffnessTable();

// InvalidArgument, naming the class, unless the table is as described, moduli are positive and
// finite, and factors are of all classes or of none.
absl::Status CheckStiffnessTable(const StiffnessTable& table);

// Place in the table of the class of a CT number. REQUIRES: CheckStiffnessTable(table) is OK.
int TissueOf(const StiffnessTable& table, double hu);

}  // namespace tissueform
