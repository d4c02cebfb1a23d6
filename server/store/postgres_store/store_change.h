// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

namespace tissueform {

// What other servers must know of a change that one of them, or anybody else, has made in the
// database.
struct StoreChange {
  enum class Kind {
    kSessionCreated,
    kSessionDeleted,
    kSessionChanged,  // its record, not its poses
    kMeshDeleted,
    kCaseCreated,
    kCaseDeleted,
    kPredictionCreated,
    kPredictionDeleted,
    kAccessChanged,  // shares, links or rights: no name; load them again
    kExportsChanged,
    kMissed,  // the connection was lost: anything may have changed
  };

  Kind kind = Kind::kMissed;
  std::string name = {};   // id or SHA-256
  std::string owner = {};  // of a case

  friend bool operator==(const StoreChange&, const StoreChange&) = default;
};

// A change as the triggers tell it ("session_deleted ID", "case_created SHA256 OWNER"). One that is
// not known, which a newer server may tell, is kMissed.
StoreChange ParseStoreChange(const std::string& notice);

}  // namespace tissueform
