// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "server/platform/storage/data_folder.h"
#include "server/store/sql_stores.h"

namespace tissueform {

// What was found damaged when a store was opened.
struct DamagedItem {
  std::string what;       // "session \"a\"", "mesh 0123...", "the database"
  std::string why;        // what is wrong with it
  std::string set_aside;  // the file that holds what was there; empty: nothing was
};

struct DurableStoreOptions {
  UnixClock clock = SystemUnixSeconds;
  UploadLimits uploads = {};
  // Blobs whose digest is checked at the start, in bytes, the newest first; of the others only the
  // size. Those are checked whenever they are read.
  int64_t max_checked_bytes = int64_t{4} << 30;
};

// What the server keeps for good: rows in one SQLite database, meshes, positions and cases as files
// beside it (docs/operations.md, "Stored data").
//
// One thread writes rows, in the order of the calls; what waits is committed together. A call is
// answered after its commit, on that thread for SessionStore. From such an answer the blocking
// stores must not be called: they would wait for themselves.
class DurableStore final : public SqlStores {
 public:
  // Opens the store, or makes it. A store of a version before is brought to this one's. Checks
  // all of it: what is damaged is moved to the folder `damaged` and stands in damaged(), the rest
  // serves. Blobs that nothing claims are removed.
  //
  // Errors: FailedPrecondition (written by a newer server; no database at all), ResourceExhausted
  // (the disk is full), or what the disk says.
  static absl::StatusOr<std::unique_ptr<DurableStore>> Open(DataFolder folder,
                                                            DurableStoreOptions options = {});

  ~DurableStore() override;

  std::string folder() const override;
  bool keeps() const override { return true; }

  const std::vector<DamagedItem>& damaged() const;

 private:
  struct Parts;

  DurableStore(std::unique_ptr<Parts> parts, std::unique_ptr<UploadStore> uploads, UnixClock clock);

  const std::unique_ptr<Parts> parts_;
};

}  // namespace tissueform
