// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "client/pacs_bridge/network/dimse_association.h"

class DcmDataset;

// C-FIND, C-MOVE and C-GET of the study root, one request each on an association that has the
// service.
namespace tissueform {

// A query: a level, keys with a value to match, and keys without a value, which the peer fills in.
struct StudyRootQuery {
  std::string level = {};  // "STUDY", "SERIES", "IMAGE"
  std::vector<std::pair<DcmTagKey, std::string>> keys = {};
};

// Answers beyond these are not looked at.
inline constexpr int kMaxAnswers = 10'000;

// Errors: those of PacsClient.
absl::Status FindByDimse(const std::string& peer_name, DimseAssociation* association,
                         const StudyRootQuery& query, int silence_seconds,
                         const std::function<void(DcmDataset* answer)>& take);

// The peer sends them to `destination`, which it knows by this AE title.
absl::StatusOr<FetchCounts> MoveByDimse(const std::string& peer_name, DimseAssociation* association,
                                        const StudyRootQuery& query, const std::string& destination,
                                        int silence_seconds);

// They come on the same association; `announced` holds the sender's AE title and address.
absl::StatusOr<FetchCounts> GetByDimse(const std::string& peer_name, DimseAssociation* association,
                                       const StudyRootQuery& query, int silence_seconds,
                                       const AnnouncedInstance& announced,
                                       const InstanceFolder& folder, InstanceSink* sink);

}  // namespace tissueform
