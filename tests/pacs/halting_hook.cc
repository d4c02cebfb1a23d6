// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// Linked to tissueform-pacs this is tissueform-pacs-halting: the bridge as it is, but it stops
// (SIGSTOP) at a fault point that a test wants, so that the test may kill a program exactly there.
// In the folder TISSUEFORM_HALT_DIR the file `want` names the point; the thread that passes it
// renames the file to `reached`, and the bridge stops until SIGCONT.

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>
#include <unistd.h>

#include "server/platform/storage/fault_points.h"

namespace tissueform {
namespace {

std::string halt_folder;  // constant once there are threads

void HaltWhereWanted(const char* name) {
  const std::string want = halt_folder + "/want";
  std::string wanted;
  if (!(std::ifstream(want) >> wanted) || wanted != name) return;
  if (std::rename(want.c_str(), (halt_folder + "/reached").c_str()) != 0) return;
  kill(getpid(), SIGSTOP);
}

[[maybe_unused]] const bool hooked = [] {
  const char* const folder = std::getenv("TISSUEFORM_HALT_DIR");
  if (folder == nullptr) return false;
  halt_folder = folder;
  fault_hook = HaltWhereWanted;
  return true;
}();

}  // namespace
}  // namespace tissueform
