// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/resampled_ct.h"

#include <utility>

#include "core/base/status_macros.h"
#include "core/imaging/ct/ct_volume_reader.h"

namespace tissueform {

absl::StatusOr<ResampledCt> ReadResampledCt(const std::string& path, const Recipe& recipe,
                                            int threads,
                                            const std::function<void()>& before_resampling) {
  TF_ASSIGN_OR_RETURN(CtVolume volume, ReadCtVolume(path, recipe.ct));
  TF_ASSIGN_OR_RETURN(CtValuesReport values, PrepareValues(recipe.ct, &volume));
  before_resampling();
  ResampledCt result{.provenance = std::move(volume.provenance),
                     .values = std::move(values),
                     .size = volume.size,
                     .spacing_mm = volume.spacing_mm,
                     .frame_uid = volume.frame_uid,
                     .unscanned = {},
                     .ct = {}};
  TF_ASSIGN_OR_RETURN(result.ct, ResampleWithoutStreaks(std::move(volume), recipe.spacing_mm,
                                                        recipe.metal, threads));
  result.unscanned = std::move(result.ct.unscanned);
  return result;
}

Recipe WithThresholds(Recipe recipe, const CtValuesReport& values) {
  if (!values.gray) return recipe;
  recipe.segmentation.tissue_above_hu = values.tissue_above_hu;
  recipe.segmentation.bone_above_hu = values.bone_above_hu;
  return recipe;
}

}  // namespace tissueform
