// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cstdlib>
#include <string>
#include <vector>

#include "absl/strings/string_view.h"

#include "server/store/session_record.h"
#include "server/store/store_records.h"
#include "tests/fuzz/fuzz_target.h"

namespace tissueform::fuzz {
namespace {

// What `parse` accepts must come back from what `serialize` makes of it, and so again.
template <typename Parse, typename Serialize>
void RoundTrip(absl::string_view bytes, Parse parse, Serialize serialize) {
  const auto record = parse(bytes);
  if (!record.ok()) {
    if (!absl::IsDataLoss(record.status())) std::abort();
    return;
  }
  const std::string once = serialize(*record);
  const auto again = parse(once);
  if (!again.ok() || serialize(*again) != once) std::abort();
}

void CheckSession(const SessionRecord& record) {
  std::vector<bool> seen(record.node_order.size());
  for (const int32_t vertex : record.node_order) seen.at(static_cast<size_t>(vertex)) = true;
  for (const bool is_seen : seen) {
    if (!is_seen) std::abort();
  }
  const size_t poses = record.last_poses.size();
  if (poses != 0 && poses != record.handles.size()) std::abort();
}

}  // namespace

void FuzzStoreRecord(const uint8_t* data, size_t size) {
  if (size == 0) return;
  const absl::string_view bytes(reinterpret_cast<const char*>(data) + 1, size - 1);
  switch (data[0] % 7) {
    case 0:
      if (const auto record = ParseRecord(bytes); record.ok()) CheckSession(*record);
      RoundTrip(bytes, ParseRecord, SerializeRecord);
      break;
    case 1:
      RoundTrip(bytes, ParsePoses, SerializePoses);
      break;
    case 2:
      RoundTrip(bytes, ParseMesh, SerializeMesh);
      break;
    case 3:
      RoundTrip(bytes, ParseAnnouncement, SerializeAnnouncement);
      break;
    case 4:
      RoundTrip(bytes, ParsePrediction, SerializePrediction);
      break;
    case 5:
      if (Unseal(bytes).ok() && bytes.size() < 64) std::abort();
      if (Unseal(Seal(bytes)).value() != bytes) std::abort();
      break;
    case 6:
      RoundTrip(bytes, ParseCaseRecord, SerializeCaseRecord);
      break;
  }
}

}  // namespace tissueform::fuzz
