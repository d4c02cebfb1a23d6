// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/pacs_bridge/bridge_options.h"

namespace tissueform {

enum class BridgeRunKind { kEverything, kReceiving };

// Runs the bridge until SIGTERM or SIGINT, which must be blocked on every thread; the exit code.
// Prints `receiving on HOST:PORT` and `review page on URL` on stdout when it is ready, and notifies
// systemd; logs go to stderr.
int RunBridge(const BridgeOptions& options, BridgeRunKind kind);

}  // namespace tissueform
