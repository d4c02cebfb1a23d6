// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>

namespace tissueform {

// Of plans that a server builds (--plan-builds and what follows it).
struct PlanBuildLimits {
  int at_once = 1;                               // builds that run; 0: the server builds none
  int max_waiting = 100;                         // not done, of all principals
  int max_waiting_of_principal = 10;             // not done
  int max_per_day = 100;                         // begun by one principal in 24 hours
  int64_t max_file_bytes = int64_t{4} << 30;     // of one build file
  int64_t max_files_bytes = int64_t{32} << 30;   // of all build files together
  int max_files = 1'000;                         // of all principals
  int retention_hours = 24;                      // of files that were kept, and of builds
  int draft_hours = 14 * 24;                     // of a draft that nothing was built of
  int max_drafts_of_principal = 200;             // that nothing was built of
  int64_t max_memory_bytes = int64_t{12} << 30;  // of the program that builds
  int max_seconds = 1'800;                       // of one build
  int64_t max_output_bytes = int64_t{4} << 30;   // of a file that it writes
};

}  // namespace tissueform
