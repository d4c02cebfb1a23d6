// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/audit/event_limit.h"

#include <utility>

namespace tissueform {

bool EventLimit::Admit(const std::string& source, Time now) {
  if (now >= period_end_) {
    counts_.clear();
    period_end_ = now + options_.period;
  }
  const auto known = counts_.find(source);
  const bool has_room = known == counts_.end() ? counts_.size() < options_.max_sources
                                               : known->second < options_.max_per_source;
  if (!has_room) {
    ++dropped_;
    return false;
  }
  ++counts_[source];
  return true;
}

int64_t EventLimit::TakeDropped() { return std::exchange(dropped_, 0); }

}  // namespace tissueform
