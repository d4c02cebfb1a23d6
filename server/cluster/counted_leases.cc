// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/cluster/counted_leases.h"

namespace tissueform {

absl::StatusOr<LeaseAnswer> CountedLeases::Acquire(const std::string& session) {
  absl::StatusOr<LeaseAnswer> answer = leases_.Acquire(session);
  if (!answer.ok()) {
    counts_.takings_failed += absl::IsNotFound(answer.status()) ? 0 : 1;
  } else {
    ++(answer->mine ? counts_.taken : counts_.refused);
  }
  return answer;
}

absl::StatusOr<std::vector<SessionLease>> CountedLeases::Renew() {
  absl::StatusOr<std::vector<SessionLease>> leases = leases_.Renew();
  ++(leases.ok() ? counts_.renewed : counts_.renewals_failed);
  if (leases.ok()) renewed_ = std::chrono::steady_clock::now();
  return leases;
}

absl::Status CountedLeases::Release(const std::string& session, int64_t epoch) {
  absl::Status status = leases_.Release(session, epoch);
  ++(status.ok() ? counts_.released : counts_.releases_failed);
  return status;
}

std::chrono::duration<double> CountedLeases::SinceRenewal() const {
  return std::chrono::steady_clock::now() - renewed_.load();
}

}  // namespace tissueform
