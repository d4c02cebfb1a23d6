// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

namespace tissueform {

// 128 random bits in 32 hexadecimal digits: an id cannot be guessed, and ids do not repeat, even
// across machines.
std::string RandomId();

}  // namespace tissueform
