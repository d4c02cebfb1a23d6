// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

namespace tissueform {

enum class KernelKind { kSoft, kBone, kUnknown };

// By the names that manufacturers give their kernels: "H60s" (sharp from 50 on), "BONEPLUS",
// "FC81"; a name that says neither is unknown.
KernelKind KernelKindOf(const std::string& kernel);

}  // namespace tissueform
