// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

namespace tissueform {

// From now on blocks of 1 MiB and more go back to the system as soon as they are freed. Left alone,
// glibc raises that size to the largest block freed so far, up to 32 MiB, and keeps what lies below
// it: tens of megabytes a session that were needed for its preparation only. Call it at the start
// of a program, before threads.
void ReturnFreedMemory();

}  // namespace tissueform
