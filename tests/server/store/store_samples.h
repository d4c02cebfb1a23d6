// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "core/mesh/payload/mesh_payload.h"
#include "server/store/case_store.h"
#include "server/store/mesh_store.h"
#include "server/store/prediction_store.h"
#include "server/store/session_record.h"
#include "server/store/upload_store.h"

namespace tissueform {

// Numbers choose the content: equal for equal numbers, different for others.

// Arrays of a mesh; no solid need be in them.
MeshPayload SamplePayload(int number, int num_vertices = 50);
MeshRecord RecordOf(const MeshPayload& payload);
UploadAnnouncement AnnouncementOf(const MeshPayload& payload);
// The payload as it is sent.
std::string BytesOf(const MeshPayload& payload);

SessionRecord SampleSession(const std::string& id, int number);
// For the handles of a sample session.
std::vector<HandlePose> SamplePoses(int number);

PredictionRecord SamplePrediction(const std::string& id, const std::string& owner = "planner",
                                  const std::string& session = "s", int64_t vertex_count = 40);
std::string SamplePositions(int number, int64_t vertex_count = 40);

// The file of a case, and what is said of it.
std::string SampleCase(int number, size_t size = 5000);
// Of a case of its owner.
CaseKey SampleCaseKey(const std::string& sha256);
CaseRecord CaseRecordOf(const std::string& bytes);
// Sends it in two pieces.
absl::StatusOr<CaseRecord> KeepCase(CaseStore& store, const CaseRecord& record,
                                    const std::string& bytes, int most = 100);
// All of it, in pieces.
absl::StatusOr<std::string> ReadWholeCase(CaseStore& store, const std::string& sha256,
                                          int64_t now_s = 0);

}  // namespace tissueform
