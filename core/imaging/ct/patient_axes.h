// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/imaging/ct/ct_volume.h"

namespace tissueform {

// Checks three letters of L R A P S I, one of each pair, where axes i, j, k of a file grow toward.
absl::Status CheckAxes(const std::string& axes);

// Columns: the unit vectors of those directions in LPS. REQUIRES: CheckAxes(axes) is OK.
Eigen::Matrix3d DirectionOf(const std::string& axes);

// The letters to which the columns of a direction matrix come closest: "LPS" for the identity.
std::string AxesOf(const Eigen::Matrix3d& direction);

// Gives a volume whose file states (`stated`) or does not state how it lies in the patient the
// place that file and recipe (`axes`, empty when the recipe has none) agree on. `where` is what the
// file says instead, for the message: `NRRD without "space"`.
//
// Without a statement the file's own directions are taken for LPS when they are not the identity
// and `axes` agrees with them; with the identity, `axes` are the directions, and the file's origin
// is laid along them.
//
// Errors: InvalidArgument when neither says it; when the two contradict each other.
absl::Status PlaceVolume(bool stated, const std::string& where, const std::string& axes,
                         CtVolume* volume);

}  // namespace tissueform
