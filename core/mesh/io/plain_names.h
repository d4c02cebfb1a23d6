// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace tissueform {

// A private folder with links to files, under names that we choose. Gmsh and TetGen look at names:
// they want endings in lower case, copy them into buffers of fixed size, and Gmsh runs a script
// that lies beside a mesh ("a.msh.opt"). The folder goes with the object. Internal to core/mesh/io.
class PlainNames {
 public:
  // Errors: those of the system, when there is no place for temporary files.
  static absl::StatusOr<PlainNames> Create();

  PlainNames(PlainNames&& other) noexcept;
  PlainNames& operator=(PlainNames&&) = delete;
  ~PlainNames();

  // Links `name` to the file `target`; `name` holds no slash.
  absl::Status Link(const std::string& target, absl::string_view name) const;

  // Writes a file.
  absl::Status Write(absl::string_view name, absl::string_view contents) const;

  std::string Path(absl::string_view name) const;

 private:
  explicit PlainNames(std::string folder);

  std::string folder_;  // empty when moved away
};

}  // namespace tissueform
