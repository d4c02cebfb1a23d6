// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// Read by the compiler ahead of every file of ours (see TissueformTargets.cmake): the large headers
// that most of them include anyway. Each file still includes what it uses: clang-tidy compiles it
// without this one.

#pragma once

#include <algorithm>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/SparseCore>
