// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/shared/option_checks.h"

#include <filesystem>

namespace tissueform {
namespace {

CLI::Validator Ending(const std::string& ending, const std::string& form) {
  const auto check = [ending](std::string& path) {
    return std::filesystem::path(path).extension() == ending ? std::string()
                                                             : path + " must end with " + ending;
  };
  return {check, form, ending + " ending"};
}

}  // namespace

CLI::Validator VtuEnding() { return Ending(".vtu", "OUT.vtu"); }
CLI::Validator VtpEnding() { return Ending(".vtp", "FILE.vtp"); }

void AddAllowOutside(CLI::App* command, PlanReadOptions* options) {
  command->add_flag("--allow-outside", options->allow_outside,
                    "let the plan name a mesh outside its own folder");
}

}  // namespace tissueform
