// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"

#include "core/base/duration_histogram.h"
#include "server/store/case_store.h"
#include "server/store/mesh_store.h"
#include "server/store/prediction_store.h"
#include "server/store/session_store.h"
#include "server/store/sql_database.h"
#include "server/store/upload_store.h"

namespace tissueform {

// All that a server keeps: sql_stores.h.
//
// Its end waits for the calls that were made; no more may be made then.
class Stores {
 public:
  virtual ~Stores() = default;

  virtual SessionStore& sessions() = 0;
  virtual MeshStore& meshes() = 0;
  virtual UploadStore& uploads() = 0;
  virtual PredictionStore& predictions() = 0;
  virtual CaseStore& cases() = 0;

  // Of each reading or writing of rows, until it is durable; null where nothing is.
  virtual const DurationHistogram* latency() const { return nullptr; }
  // Where it is kept; empty: in memory.
  virtual std::string folder() const { return {}; }
  // In which other rooms keep rows of theirs, too.
  virtual SqlDatabase& database() = 0;
  // What is acknowledged outlives the process; so must the rows of other rooms.
  virtual bool keeps() const = 0;

  // Unix seconds, for what is kept: this machine's clock, or that of a database which several
  // servers share, as it was asked last. Fast.
  virtual int64_t NowS() const { return SystemUnixSeconds(); }
  // Asks the database. Blocks. Errors: what the store says; then it is unknown what is old.
  virtual absl::Status AskTime() { return absl::OkStatus(); }
};

}  // namespace tissueform
