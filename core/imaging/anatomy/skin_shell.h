// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/imaging/anatomy/head_segmentation.h"
#include "core/imaging/anatomy/landmarks.h"
#include "core/imaging/ct/voxel_grid.h"

namespace tissueform {

// The voxels (1) that carry the outer skin where it is that of teeth which an open mouth shows:
// near bone, and behind and between the lips. With their blur, which is as thin as no lip.
LabelGrid ExposedTeeth(const HeadSegmentation& head, const LabelGrid& outside_air,
                       const Landmarks& landmarks);

// The tissue behind the outer skin (core/imaging/anatomy/outer_skin.h): all voxels (1) up to
// `thickness_mm` behind it, regardless of the CT's values there. Where skin is thinner than that,
// this is air of the nose or the mouth, or bone: the walls of a nose are 2 to 3 mm thin, and so is
// the skin of its bridge. A model without them has no nose, or holes to the bone.
//
// Not behind the skin is air that reaches the outside by a straight way (the end of a nostril is
// not plugged), and what lies behind teeth that are exposed in an open mouth, nor these.
//
// `outside_air` is OutsideAir(head).
LabelGrid SkinShell(const HeadSegmentation& head, const LabelGrid& outside_air,
                    const Landmarks& landmarks, double thickness_mm);

// The voxels that are part of a block of 2 x 2 x 2 in the mask: without hairs and free sheets of
// one voxel.
LabelGrid WithoutSingleLayers(const LabelGrid& mask);

}  // namespace tissueform
