// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/option_checks.h"

#include <filesystem>

namespace tissueform {

CLI::Validator VtuEnding() {
  const auto check = [](std::string& path) {
    return std::filesystem::path(path).extension() == ".vtu" ? std::string()
                                                             : path + " must end with .vtu";
  };
  return {check, "OUT.vtu", "vtu ending"};
}

void AddAllowOutside(CLI::App* command, PlanReadOptions* options) {
  command->add_flag("--allow-outside", options->allow_outside,
                    "let the plan name a mesh outside its own folder");
}

}  // namespace tissueform
