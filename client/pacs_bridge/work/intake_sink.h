// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>

#include "absl/status/status.h"

#include "client/pacs_bridge/network/instance_sink.h"
#include "client/pacs_bridge/work/series_intake.h"
#include "core/base/mutex.h"

namespace tissueform {

// Shows what is received to the intake. What comes again with other bytes is refused: it is unknown
// which of two images of one name is right. Thread-safe.
class IntakeSink final : public InstanceSink {
 public:
  explicit IntakeSink(SeriesIntake* intake) : intake_(intake) {}

  absl::Status Keep(const ReceivedInstance& instance) override;
  void AssociationEnded(const EndedAssociation& ended) override;

 private:
  SeriesIntake* const intake_;

  Mutex mutex_;
  // Series that associations which are open have brought.
  std::map<int64_t, std::set<std::string>> series_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
