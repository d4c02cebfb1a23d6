// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

namespace tissueform {

// What other servers must know of a change in the database, by one of them or by any other
// client.
struct StoreChange {
  enum class Kind {
    kSessionCreated,
    kSessionDeleted,
    kSessionChanged,  // its record, not its poses
    kMeshDeleted,
    kExportsChanged,  // no name
    kMissed,          // the connection was lost: anything may have changed
  };

  Kind kind = Kind::kMissed;
  std::string name = {};  // of a session or a mesh

  friend bool operator==(const StoreChange&, const StoreChange&) = default;
};

// A change as the triggers report it ("session_deleted ID"). One that is not known, which a newer
// server may report, is kMissed.
StoreChange ParseStoreChange(const std::string& notice);

}  // namespace tissueform
