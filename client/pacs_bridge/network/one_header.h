// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <initializer_list>
#include <string>

#include "absl/status/status.h"

#include "client/pacs_bridge/network/instance_folder.h"
#include "client/pacs_bridge/network/instance_sink.h"

namespace tissueform {

// Lets `fetch` bring one object that the PACS has listed into a folder next to `path`, keeps its
// header, without pixels, as the file `path` (0600), and removes the rest.
//
// Errors: Unavailable when the object did not arrive, if `fetch` returns OK or NotFound; other
// errors of `fetch`; those of CopyHeaderOnly.
absl::Status KeepOneHeader(
    const std::string& path,
    const std::function<absl::Status(const InstanceFolder& folder, InstanceSink* sink)>& fetch);

// Errors: InvalidArgument when one is no UID.
absl::Status CheckDicomUids(std::initializer_list<std::string> uids);

}  // namespace tissueform
