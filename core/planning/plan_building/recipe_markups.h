// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>

#include "absl/status/status.h"
#include "nlohmann/json_fwd.hpp"

namespace tissueform {

// Replaces in a recipe, which has passed its schema, what names a markups file by what the file
// says, in numbers:
//   planes             {"file"} becomes {"point_mm", "normal"}. The normal of the occlusal plane,
//   of
//                      the head frame and of the region of interest is turned to the side that
//                      the key means; that of a segment's plane stays, or is turned by "flip".
//   lips               "mouth_line_file" becomes "mouth_line_mm", from right to left
//   landmarks          {"file"} becomes {"points_mm"}
//
// Relative files are files of `folder`; without a folder a recipe must not name any.
//
// Errors: InvalidArgument with the JSON pointer and the reason; those of ReadMarkups.
absl::Status InsertMarkups(const std::optional<std::string>& folder, nlohmann::json* recipe);

}  // namespace tissueform
