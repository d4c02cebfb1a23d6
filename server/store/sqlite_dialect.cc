// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/sqlite_dialect.h"

#include "absl/strings/str_replace.h"

namespace tissueform {

std::string ToSqlite(absl::string_view sql) {
  // If several replacements start at one place, the longest wins.
  return absl::StrReplaceAll(
      sql, {
               // Only one transaction writes at a time, so rows need no locks. A server with a
               // store of its own needs no new epochs.
               {" FOR UPDATE OF session_states", ""},
               {" FOR UPDATE", ""},
               {" FOR KEY SHARE", ""},
               {"nextval('session_epochs')", "0"},
               // A parameter has the type of its value.
               {"::bigint", ""},
               {"$", "?"},
               {"GREATEST(", "max("},
               {"encode(convert_to(owner, 'UTF8'), 'hex')", "lower(hex(owner))"},
               // SqlNames contains no character that JSON would escape.
               {"= ANY (string_to_array($", "IN (SELECT value FROM json_each('[\"' || replace(?"},
               {", chr(31)))", ", char(31), '\",\"') || '\"]'))"},
           });
}

}  // namespace tissueform
