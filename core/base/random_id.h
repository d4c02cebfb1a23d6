// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

namespace tissueform {

// 128 random bits in 32 hexadecimal digits: who does not know an id does not guess it, and none
// comes again, on whatever machine it is made.
std::string RandomId();

}  // namespace tissueform
