// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/work/intake_sink.h"

namespace tissueform {

absl::Status IntakeSink::Keep(const ReceivedInstance& instance) {
  if (instance.novelty == ReceivedInstance::Novelty::kChanged) {
    return absl::AlreadyExistsError("an image was received again with other bytes");
  }
  {
    MutexLock lock(mutex_);
    series_[instance.association].insert(instance.header.series_uid);
  }
  intake_->Arrived(instance.path, instance.header);
  return absl::OkStatus();
}

void IntakeSink::AssociationEnded(const EndedAssociation& ended) {
  std::set<std::string> brought;
  {
    MutexLock lock(mutex_);
    const auto found = series_.find(ended.association);
    if (found == series_.end()) return;
    brought.swap(found->second);
    series_.erase(found);
  }
  intake_->Ended({brought.begin(), brought.end()}, ended.released && ended.refused == 0);
}

}  // namespace tissueform
