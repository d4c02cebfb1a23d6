// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/deformer.h"

namespace tissueform {

absl::string_view GaveUpName(GaveUp gave_up) {
  switch (gave_up) {
    case GaveUp::kNo:
      break;
    case GaveUp::kIterations:
      return "iterations";
    case GaveUp::kNoRoom:
      return "no_room";
    case GaveUp::kArithmetic:
      return "arithmetic";
    case GaveUp::kBlocked:
      return "blocked";
  }
  return "";
}

}  // namespace tissueform
