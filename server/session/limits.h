// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>

namespace tissueform {

// What the service accepts from outside. The first group can be changed on the command line of the
// server.
struct ServiceLimits {
  int64_t max_vertices = 2'000'000;
  int64_t max_tets = 12'000'000;
  int64_t max_mesh_bytes = int64_t{1} << 30;
  int max_sessions = 64;
  int max_stored_sessions = 10'000;  // in memory or not
  int64_t max_case_bytes = int64_t{512} << 20;
  int max_cases = 1'000;
  int max_streams = 64;
  int max_watches = 256;
  int max_watches_per_session = 16;
  std::chrono::seconds session_idle_ttl{1800};
  int retention_days = 30;  // what was not used for so long is deleted; 0: nothing is
  // A client that says nothing for so long is given up.
  std::chrono::milliseconds configuration_deadline{10'000};  // of a stream, from its opening on
  std::chrono::milliseconds upload_silence{30'000};          // between two chunks

  int max_handles = 256;
  int max_cell_arrays = 16;
  int max_name_bytes = 128;  // of handles and cell arrays
  int max_request_id_bytes = 64;
  int max_title_bytes = 256;  // of cases and predictions
  int max_case_uploads = 16;  // being sent at the same time
  int64_t max_chunk_bytes = 1 << 20;
  int64_t max_prepared_answer_bytes = int64_t{64} << 20;  // that are sent to one client
  int max_unacked = 64;                                   // frames of a stream
  int max_iterations = 1000;                              // linear solves of one answer
};

}  // namespace tissueform
