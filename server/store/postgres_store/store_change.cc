// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/store_change.h"

#include <cstddef>
#include <map>

namespace tissueform {

StoreChange ParseStoreChange(const std::string& notice) {
  static const auto* const kinds = new std::map<std::string, StoreChange::Kind>{
      {"session_created", StoreChange::Kind::kSessionCreated},
      {"session_deleted", StoreChange::Kind::kSessionDeleted},
      {"session_changed", StoreChange::Kind::kSessionChanged},
      {"mesh_deleted", StoreChange::Kind::kMeshDeleted},
      {"exports_changed", StoreChange::Kind::kExportsChanged}};
  const size_t space = notice.find(' ');
  if (space == std::string::npos) return {};
  const auto found = kinds->find(notice.substr(0, space));
  if (found == kinds->end()) return {};
  return {.kind = found->second, .name = notice.substr(space + 1)};
}

}  // namespace tissueform
