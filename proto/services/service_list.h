// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include "google/protobuf/descriptor.h"

namespace tissueform {

// The services of package tissueform.v1, by name: the one list that the server's metrics and the
// gateway work from. A service that is missing here is not linked, and its calls are unknown.
// The descriptors live as long as the program. Any thread may call it.
const std::vector<const google::protobuf::ServiceDescriptor*>& AllServices();

}  // namespace tissueform
