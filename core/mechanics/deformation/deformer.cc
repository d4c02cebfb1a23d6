// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/deformer.h"

namespace tissueform {

absl::string_view TerminationName(Termination gave_up) {
  switch (gave_up) {
    case Termination::kConverged:
      break;
    case Termination::kIterations:
      return "iterations";
    case Termination::kNoRoom:
      return "no_room";
    case Termination::kArithmetic:
      return "arithmetic";
    case Termination::kBlocked:
      return "blocked";
  }
  return "";
}

}  // namespace tissueform
