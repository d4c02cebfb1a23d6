// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

namespace tissueform {

// Of this build. In a library of its own, so that a new commit links little again.
const char* SoftwareVersion();  // "0.2.0"
const char* SoftwareCommit();   // of the last configuration; "unknown" outside of a checkout

}  // namespace tissueform
