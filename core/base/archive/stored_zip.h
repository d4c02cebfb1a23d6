// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace tissueform {

struct ZipMember {
  std::string path;  // in the zip
  std::string bytes;
};

// A zip that holds the members as they are, without compression and without times: the same members
// give the same bytes. Errors: ResourceExhausted for more than 65535 members or 4 GiB.
absl::StatusOr<std::string> StoredZip(const std::vector<ZipMember>& members);

}  // namespace tissueform
