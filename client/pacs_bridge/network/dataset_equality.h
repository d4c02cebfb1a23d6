// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

namespace tissueform {

// Whether two files (PS3.10) hold the same data set to the last bit. What senders write before it,
// in the meta header, differs also for one object.
bool DatasetsAreEqual(const std::string& one, const std::string& other);

}  // namespace tissueform
