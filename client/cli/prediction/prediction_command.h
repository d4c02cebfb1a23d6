// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/shared/command_line.h"

namespace tissueform {

// `tissueform prediction create|list|show|compare|export|delete|send|sent|unsend`: answers that a
// server keeps.
void AddPredictionCommand(CLI::App& app, CommandWork* work);

}  // namespace tissueform
