// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/sqlite_dialect.h"

#include "absl/strings/str_replace.h"

namespace tissueform {

std::string ToSqlite(absl::string_view sql) {
  // Where several could begin at one place the longest is taken.
  return absl::StrReplaceAll(
      sql, {
               // Only one transaction writes: rows need no locks, and no epochs are given.
               {" FOR UPDATE OF session_states", ""},
               {" FOR UPDATE", ""},
               {" FOR KEY SHARE", ""},
               {"nextval('session_epochs')", "0"},
               // A parameter has the type of what is bound to it.
               {"::bigint", ""},
               {"$", "?"},
               {"GREATEST(", "max("},
               {"encode(convert_to(owner, 'UTF8'), 'hex')", "lower(hex(owner))"},
               // SqlNames leaves out what JSON would escape.
               {"= ANY (string_to_array($", "IN (SELECT value FROM json_each('[\"' || replace(?"},
               {", chr(31)))", ", char(31), '\",\"') || '\"]'))"},
           });
}

}  // namespace tissueform
