// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

namespace tissueform {

// Errors of files and databases name paths and addresses of this machine. The log and the operator
// need them; clients must not see them. These functions mark what to hide.

// `status` whose message contains the file or folder `path` of this machine. OK stays OK.
absl::Status NamingPath(absl::Status status, absl::string_view path);
// `status` with one plain sentence for clients; its message is for the log and the operator. OK
// stays OK.
absl::Status WithClientMessage(absl::Status status, absl::string_view sentence);
bool HasClientMessage(const absl::Status& status);
// That sentence, or the message of `status` without such a path.
std::string MessageForClients(const absl::Status& status);

}  // namespace tissueform
