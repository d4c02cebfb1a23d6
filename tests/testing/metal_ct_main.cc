// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// Writes the bundled head as a scanner would show it, without metal (twice, with other
// noise), with fillings and with braces:
// tissueform-metal-ct FOLDER makes FOLDER/{free,again,fillings,braces}.nrrd, which need no key of
// "ct" in a recipe.

#include <iostream>
#include <string>
#include <utility>

#include "absl/status/statusor.h"

#include "core/base/parallel_for.h"
#include "core/base/status_macros.h"
#include "tests/testing/metal_phantom.h"
#include "tests/testing/nrrd_file.h"

namespace {

using tissueform::testing::SimulatedHeads;

absl::Status WriteHeads(const std::string& folder) {
  TF_ASSIGN_OR_RETURN(const SimulatedHeads heads,
                      tissueform::testing::SimulateHeads(tissueform::AvailableProcessors()));
  for (const auto& [name, head] :
       {std::pair("free", &heads.free), std::pair("again", &heads.again),
        std::pair("fillings", &heads.fillings), std::pair("braces", &heads.braces)}) {
    TF_RETURN_IF_ERROR(tissueform::testing::WriteNrrd(folder + "/" + name + ".nrrd", *head));
  }
  return absl::OkStatus();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: tissueform-metal-ct FOLDER\n";
    return 2;
  }
  const absl::Status written = WriteHeads(argv[1]);
  if (written.ok()) return 0;
  std::cerr << written.message() << '\n';
  return 1;
}
