// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

import { webcrypto } from "node:crypto";

// Every browser has it; Node 18 keeps it in a module.
globalThis.crypto ??= webcrypto as Crypto;
