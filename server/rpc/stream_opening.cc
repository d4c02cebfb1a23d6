// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/stream_opening.h"

#include <utility>

#include "core/base/status_macros.h"

namespace tissueform {

absl::Status StreamOpening::TakeRequest(const v1::DeformConfiguration& proto,
                                        const ServiceLimits& limits) {
  TF_ASSIGN_OR_RETURN(request_, ReadStreamRequest(proto, limits));
  return absl::OkStatus();
}

absl::Status StreamOpening::TakeSession(std::shared_ptr<Session> session) {
  if (configuration_ == nullptr) {
    TF_ASSIGN_OR_RETURN(configuration_, ReadConfiguration(request_, std::move(session)));
    return absl::OkStatus();
  }
  if (configuration_->session->updated()) returning_ = Returning::kUpdated;
  TF_ASSIGN_OR_RETURN(configuration_,
                      ConfigurationFor(request_, *configuration_->session, std::move(session)));
  return absl::OkStatus();
}

std::optional<v1::DeformNotice> StreamOpening::Leave() {
  if (configuration_->session->updated()) return std::nullopt;
  returning_ = Returning::kRestored;
  v1::DeformNotice notice;
  notice.mutable_evicted();
  return notice;
}

std::optional<v1::DeformNotice> StreamOpening::Resume() {
  const Returning returning = std::exchange(returning_, Returning::kNo);
  if (returning == Returning::kNo) return std::nullopt;
  v1::DeformNotice notice;
  if (returning == Returning::kUpdated) {
    notice.mutable_updated();
  } else {
    notice.mutable_restored();
  }
  return notice;
}

}  // namespace tissueform
