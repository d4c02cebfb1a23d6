// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/software_version.h"

namespace tissueform {

const char* SoftwareVersion() { return TISSUEFORM_VERSION; }

const char* SoftwareCommit() { return TISSUEFORM_COMMIT; }

}  // namespace tissueform
