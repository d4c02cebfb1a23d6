// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/status.h"

class DcmItem;

namespace tissueform {

// Copies the attributes of the modules Patient, General Study and Patient Study (PS3.3 C.7.1.1,
// C.7.2.1, C.7.2.2) as they are, with the character set that they are written in; what `to` had of
// them is replaced or removed.
//
// Errors: Internal when DCMTK cannot copy one, with its tag.
absl::Status CopyPatientAndStudy(DcmItem* from, DcmItem* to);

}  // namespace tissueform
