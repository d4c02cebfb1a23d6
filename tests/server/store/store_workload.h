// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>

#include "absl/status/status.h"

#include "server/store/durable_store.h"

namespace tissueform {

// What a store has been asked to keep, as plain maps: what a test compares it with.
struct StoreModel {
  std::map<std::string, std::string> sessions;  // id -> SerializeRecord
  std::set<int> meshes;                         // numbers of SamplePayload
  std::map<std::string, int> predictions;       // id -> number of SamplePositions
  std::set<int> cases;                          // numbers of SampleCase
  std::map<int, int64_t> uploads;               // number of SamplePayload -> bytes committed
  std::set<std::string> erased;                 // texts that may no longer be found
  std::set<std::string> erased_blobs;           // names of their files
};

// The writes of a server, one after the other: step `number` is always the same. Every kind of
// write comes once in kStepsOfARound. What is deleted was written in the same round, and something
// that stays was written between, so that a lost deletion shows.
inline constexpr int kStepsOfARound = 19;

// Applies the step to the model. `bursts`: steps of several calls at once are made, too.
void ApplyStep(int number, bool bursts, StoreModel* model);

// Makes the calls of a step and waits for their answers.
absl::Status RunStep(int number, bool bursts, Stores& stores);

// OK when the store holds what `acknowledged` says, byte for byte; of what `begun` says otherwise,
// the one or the other.
absl::Status CheckAgainst(const StoreModel& acknowledged, const StoreModel& begun,
                          DurableStore& store);

// OK when the files of a folder, which no store has open, hold nothing that was deleted.
absl::Status CheckErased(const StoreModel& acknowledged, const std::string& folder);

}  // namespace tissueform
