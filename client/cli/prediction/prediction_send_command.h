// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/shared/command_line.h"

namespace tissueform {

// `tissueform prediction send|sent|unsend`, beside the others of `prediction`: stored predictions
// on their way to the PACS.
void AddPredictionSendCommands(CLI::App& prediction, CommandWork* work);

}  // namespace tissueform
