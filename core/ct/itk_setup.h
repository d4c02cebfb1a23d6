// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

namespace tissueform {

// Settings of ITK for this process: its filters start their threads anew and end them, so that a
// child process (fork) may use ITK too; its warnings are not printed. Every adaptor calls it before
// it uses ITK; calling it again is free. Internal to core/ct.
void SetUpItk();

}  // namespace tissueform
