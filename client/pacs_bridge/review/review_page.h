// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/strings/string_view.h"

#include "client/pacs_bridge/review/review_queue.h"

namespace tissueform {

struct ReviewPageOptions {
  std::string planner_url = {};  // "https://planner.example.org/"; empty: no links
  std::string form_token = {};   // that a form must send back
  std::string notice = {};       // one line over the lists, of what has just happened; may be empty
  bool notice_is_problem = false;
};

// The page as HTML. Everything that comes from images is escaped: nothing in a name is markup.
std::string ReviewPage(const ReviewQueue& list, const ReviewPageOptions& options);

// Its style sheet.
absl::string_view ReviewStyle();

}  // namespace tissueform
