// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/status.h"

#include "client/pacs_bridge/network/instance_folder.h"
#include "client/pacs_bridge/network/instance_sink.h"

struct T_ASC_Association;
struct T_DIMSE_C_StoreRQ;

namespace tissueform {

// Takes the data set that follows a C-STORE request on any association (C-GET's too), and answers
// it. `*status` is what the sender receives; an error: the association is broken.
absl::Status ReceiveStore(T_ASC_Association* association, int presentation_context,
                          const T_DIMSE_C_StoreRQ& request, AnnouncedInstance announced,
                          int idle_seconds, const InstanceFolder& folder, InstanceSink* sink,
                          absl::Status* status);

}  // namespace tissueform
