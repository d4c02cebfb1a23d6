// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/server/store/store_workload.h"

#include <array>
#include <filesystem>
#include <fstream>
#include <future>
#include <iterator>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"
#include "tests/server/store/store_samples.h"
#include "tests/server/store/waiting_calls.h"

namespace tissueform {
namespace {

enum Step {
  kCreateKept,
  kCommit,
  kPutMesh,
  kUpload,
  kUploadDropped,
  kCreateErased,
  kUpdate,
  kDeleteSession,
  kPutErasedMesh,
  kPredict,
  kDeleteMesh,
  kPredictErased,
  kCommitAgain,
  kDeletePrediction,
  kDropUpload,
  kBurst,
  kKeepErasedCase,
  kKeepCase,
  kDeleteCase,
};

constexpr int kBurstCalls = 6;
constexpr int64_t kUploadBytes = 1000;

std::string Kept(int round) { return absl::StrCat("kept-session-", round, "-"); }
std::string Erased(int round) { return absl::StrCat("erased-session-", round, "-"); }
std::string KeptPrediction(int round) { return absl::StrCat("kept-prediction-", round, "-"); }
std::string ErasedPrediction(int round) { return absl::StrCat("erased-prediction-", round, "-"); }
std::string Burst(int round, int call) { return absl::StrCat("burst-", round, "-", call); }

// Numbers of samples: no two of a round are the same.
int KeptMesh(int round) { return 1000 + 10 * round; }
int ErasedMesh(int round) { return 1001 + 10 * round; }
int UploadMesh(int round) { return 1002 + 10 * round; }
int DroppedMesh(int round) { return 1003 + 10 * round; }
int KeptPositions(int round) { return 1004 + 10 * round; }
int ErasedPositions(int round) { return 1005 + 10 * round; }

int KeptCase(int round) { return 1006 + 10 * round; }
int ErasedCase(int round) { return 1007 + 10 * round; }

std::string NameOfCase(int number) { return CaseRecordOf(SampleCase(number)).sha256; }

absl::Status Keep(int number, Stores& stores) {
  const std::string bytes = SampleCase(number);
  return KeepCase(stores.cases(), CaseRecordOf(bytes), bytes).status();
}

SessionRecord KeptSession(int round) { return SampleSession(Kept(round), round); }

SessionRecord UpdatedSession(int round) {
  SessionRecord record = SampleSession(Kept(round), round + 100);
  record.last_poses = SamplePoses(round + 100);
  return record;
}

std::string NameOf(int mesh) { return RecordOf(SamplePayload(mesh)).sha256; }

absl::Status PutMesh(int number, Stores& stores) {
  const MeshPayload mesh = SamplePayload(number);
  return stores.meshes().Put(RecordOf(mesh), mesh.View());
}

// Begins an upload and sends its first bytes.
absl::Status Upload(int number, Stores& stores) {
  const MeshPayload mesh = SamplePayload(number);
  const UploadAnnouncement announcement = AnnouncementOf(mesh);
  TF_ASSIGN_OR_RETURN(const int64_t offset, stores.uploads().Begin(announcement));
  if (offset < kUploadBytes) {
    TF_RETURN_IF_ERROR(
        stores.uploads().Append(announcement.sha256, offset,
                                BytesOf(mesh).substr(static_cast<size_t>(offset),
                                                     static_cast<size_t>(kUploadBytes - offset))));
  }
  return stores.uploads().Committed(announcement.sha256).status();
}

absl::Status Update(int round, Stores& stores) {
  TF_ASSIGN_OR_RETURN(const SessionRecord found, GetSession(stores.sessions(), Kept(round)));
  SessionRecord record = UpdatedSession(round);
  record.etag = found.etag;
  return UpdateSession(stores.sessions(), record).status();
}

absl::Status RunBurst(int round, Stores& stores) {
  std::vector<std::promise<absl::Status>> answers(kBurstCalls);
  for (int call = 0; call < kBurstCalls; ++call) {
    stores.sessions().Create(SampleSession(Burst(round, call), call), 1,
                             [&answers, call](const absl::StatusOr<SessionRecord>& record) {
                               answers[call].set_value(record.status());
                             });
  }
  absl::Status status;
  for (std::promise<absl::Status>& answer : answers) status.Update(answer.get_future().get());
  return status;
}

absl::Status Differs(absl::string_view what) {
  return absl::DataLossError(absl::StrCat(what, " is not as it was acknowledged"));
}

// The value of `key` in a map, or `none`.
template <typename Map, typename Key>
typename Map::mapped_type ValueOr(const Map& map, const Key& key,
                                  const typename Map::mapped_type& none) {
  const auto found = map.find(key);
  return found == map.end() ? none : found->second;
}

absl::Status CheckSessions(const StoreModel& acknowledged, const StoreModel& begun,
                           DurableStore& store) {
  TF_ASSIGN_OR_RETURN(const SessionStore::Page page,
                      ListSessions(store.sessions(), {.limit = 10000}));
  std::map<std::string, std::string> found;
  for (const SessionRecord& record : page.records) found[record.id] = SerializeRecord(record);
  std::map<std::string, std::string> all = found;
  all.insert(acknowledged.sessions.begin(), acknowledged.sessions.end());
  for (const auto& [id, bytes] : all) {
    const std::string now = ValueOr(found, id, "");
    if (now != ValueOr(acknowledged.sessions, id, "") && now != ValueOr(begun.sessions, id, "")) {
      return Differs(id);
    }
  }
  return absl::OkStatus();
}

absl::Status CheckMeshes(const StoreModel& acknowledged, const StoreModel& begun,
                         DurableStore& store) {
  for (const int number : acknowledged.meshes) {
    const absl::StatusOr<MeshPayload> read = store.meshes().Read(NameOf(number));
    if (absl::IsNotFound(read.status()) && begun.meshes.count(number) == 0) continue;
    TF_RETURN_IF_ERROR(read.status());
    if (BytesOf(*read) != BytesOf(SamplePayload(number))) return Differs("a mesh");
  }
  TF_ASSIGN_OR_RETURN(const MeshStore::Page page, store.meshes().List("", 10000));
  std::set<std::string> allowed;
  for (const int number : acknowledged.meshes) allowed.insert(NameOf(number));
  for (const int number : begun.meshes) allowed.insert(NameOf(number));
  for (const MeshRecord& record : page.records) {
    if (allowed.count(record.sha256) == 0) return Differs("the list of meshes");
    TF_RETURN_IF_ERROR(store.meshes().Read(record.sha256).status());
  }
  return absl::OkStatus();
}

absl::Status CheckPredictions(const StoreModel& acknowledged, const StoreModel& begun,
                              DurableStore& store) {
  std::map<std::string, int> all = acknowledged.predictions;
  all.insert(begun.predictions.begin(), begun.predictions.end());
  for (const auto& [id, number] : all) {
    const bool sure = acknowledged.predictions.count(id) > 0 && begun.predictions.count(id) > 0;
    const absl::StatusOr<std::string> positions = store.predictions().Positions(id);
    if (absl::IsNotFound(positions.status()) && !sure) continue;
    TF_RETURN_IF_ERROR(positions.status());
    if (*positions != SamplePositions(number)) return Differs(id);
    TF_ASSIGN_OR_RETURN(const PredictionRecord record, store.predictions().Get(id));
    if (record.metadata != SamplePrediction(id).metadata) return Differs(id);
  }
  TF_ASSIGN_OR_RETURN(const PredictionStore::Page page, store.predictions().List({.limit = 10000}));
  for (const PredictionRecord& record : page.records) {
    if (all.count(record.id) == 0) return Differs("the list of predictions");
  }
  return absl::OkStatus();
}

absl::Status CheckCases(const StoreModel& acknowledged, const StoreModel& begun,
                        DurableStore& store) {
  for (const int number : acknowledged.cases) {
    const absl::StatusOr<std::string> read = ReadWholeCase(store.cases(), NameOfCase(number));
    if (absl::IsNotFound(read.status()) && begun.cases.count(number) == 0) continue;
    TF_RETURN_IF_ERROR(read.status());
    if (*read != SampleCase(number)) return Differs("a case");
  }
  TF_ASSIGN_OR_RETURN(const CaseStore::Page page, store.cases().List({.limit = 10000}));
  std::set<std::string> allowed;
  for (const int number : acknowledged.cases) allowed.insert(NameOfCase(number));
  for (const int number : begun.cases) allowed.insert(NameOfCase(number));
  for (const CaseRecord& record : page.records) {
    if (allowed.count(record.sha256) == 0) return Differs("the list of cases");
    TF_RETURN_IF_ERROR(ReadWholeCase(store.cases(), record.sha256).status());
  }
  return absl::OkStatus();
}

// Goes on with each upload to its end: its digest proves every byte before.
absl::Status CheckUploads(const StoreModel& acknowledged, const StoreModel& begun,
                          DurableStore& store) {
  for (const auto& [number, committed] : acknowledged.uploads) {
    const MeshPayload mesh = SamplePayload(number);
    const UploadAnnouncement announcement = AnnouncementOf(mesh);
    TF_ASSIGN_OR_RETURN(const int64_t offset, store.uploads().Begin(announcement));
    if (offset < committed && begun.uploads.count(number) > 0) return Differs("an upload");
    TF_RETURN_IF_ERROR(store.uploads().Append(announcement.sha256, offset,
                                              BytesOf(mesh).substr(static_cast<size_t>(offset))));
    TF_ASSIGN_OR_RETURN(const MeshPayload read, store.uploads().Read(announcement.sha256));
    if (BytesOf(read) != BytesOf(mesh)) return Differs("the bytes of an upload");
  }
  return absl::OkStatus();
}

}  // namespace

void ApplyStep(int number, bool bursts, StoreModel* model) {
  const int round = number / kStepsOfARound;
  switch (static_cast<Step>(number % kStepsOfARound)) {
    case kCreateKept:
      model->sessions[Kept(round)] = SerializeRecord(KeptSession(round));
      break;
    case kCommit: {
      SessionRecord record = KeptSession(round);
      record.last_poses = SamplePoses(round);
      model->sessions[Kept(round)] = SerializeRecord(record);
      break;
    }
    case kPutMesh:
      model->meshes.insert(KeptMesh(round));
      break;
    case kUpload:
      model->uploads[UploadMesh(round)] = kUploadBytes;
      break;
    case kUploadDropped:
      model->uploads[DroppedMesh(round)] = kUploadBytes;
      break;
    case kCreateErased:
      model->sessions[Erased(round)] = SerializeRecord(SampleSession(Erased(round), round));
      break;
    case kUpdate:
      model->sessions[Kept(round)] = SerializeRecord(UpdatedSession(round));
      break;
    case kCommitAgain: {
      SessionRecord record = UpdatedSession(round);
      record.last_poses = SamplePoses(round + 200);
      model->sessions[Kept(round)] = SerializeRecord(record);
      break;
    }
    case kDeleteSession:
      model->sessions.erase(Erased(round));
      model->erased.insert(Erased(round));
      break;
    case kPutErasedMesh:
      model->meshes.insert(ErasedMesh(round));
      break;
    case kDeleteMesh:
      model->meshes.erase(ErasedMesh(round));
      model->erased.insert(NameOf(ErasedMesh(round)));
      model->erased_blobs.insert(NameOf(ErasedMesh(round)));
      break;
    case kPredict:
      model->predictions[KeptPrediction(round)] = KeptPositions(round);
      break;
    case kPredictErased:
      model->predictions[ErasedPrediction(round)] = ErasedPositions(round);
      break;
    case kDeletePrediction:
      model->predictions.erase(ErasedPrediction(round));
      model->erased.insert(ErasedPrediction(round));
      model->erased_blobs.insert(Sha256Hex({SamplePositions(ErasedPositions(round))}));
      break;
    case kDropUpload:
      model->uploads.erase(DroppedMesh(round));
      model->erased_blobs.insert(NameOf(DroppedMesh(round)) + ".part");
      break;
    case kBurst:
      for (int call = 0; call < kBurstCalls && bursts; ++call) {
        model->sessions[Burst(round, call)] =
            SerializeRecord(SampleSession(Burst(round, call), call));
      }
      break;
    case kKeepErasedCase:
      model->cases.insert(ErasedCase(round));
      break;
    case kKeepCase:
      model->cases.insert(KeptCase(round));
      break;
    case kDeleteCase:
      model->cases.erase(ErasedCase(round));
      model->erased.insert(NameOfCase(ErasedCase(round)));
      model->erased_blobs.insert(NameOfCase(ErasedCase(round)));
      break;
  }
}

absl::Status RunStep(int number, bool bursts, Stores& stores) {
  const int round = number / kStepsOfARound;
  switch (static_cast<Step>(number % kStepsOfARound)) {
    case kCreateKept:
      return CreateSession(stores.sessions(), KeptSession(round)).status();
    case kCommit:
      return CommitPoses(stores.sessions(), Kept(round), SamplePoses(round));
    case kPutMesh:
      return PutMesh(KeptMesh(round), stores);
    case kUpload:
      return Upload(UploadMesh(round), stores);
    case kUploadDropped:
      return Upload(DroppedMesh(round), stores);
    case kCreateErased:
      return CreateSession(stores.sessions(), SampleSession(Erased(round), round)).status();
    case kUpdate:
      return Update(round, stores);
    case kCommitAgain:
      return CommitPoses(stores.sessions(), Kept(round), SamplePoses(round + 200));
    case kDeleteSession:
      return DeleteSession(stores.sessions(), Erased(round));
    case kPutErasedMesh:
      return PutMesh(ErasedMesh(round), stores);
    case kDeleteMesh:
      return stores.meshes().Delete(NameOf(ErasedMesh(round)));
    case kPredict:
      return stores.predictions().Create(SamplePrediction(KeptPrediction(round)),
                                         SamplePositions(KeptPositions(round)));
    case kPredictErased:
      return stores.predictions().Create(SamplePrediction(ErasedPrediction(round)),
                                         SamplePositions(ErasedPositions(round)));
    case kDeletePrediction:
      return stores.predictions().Delete(ErasedPrediction(round));
    case kDropUpload:
      return stores.uploads().Drop(NameOf(DroppedMesh(round)));
    case kBurst:
      return bursts ? RunBurst(round, stores) : absl::OkStatus();
    case kKeepErasedCase:
      return Keep(ErasedCase(round), stores);
    case kKeepCase:
      return Keep(KeptCase(round), stores);
    case kDeleteCase:
      return stores.cases().Delete(SampleCaseKey(NameOfCase(ErasedCase(round))));
  }
  return absl::OkStatus();
}

absl::Status CheckAgainst(const StoreModel& acknowledged, const StoreModel& begun,
                          DurableStore& store) {
  if (!store.damaged().empty()) return Differs(store.damaged()[0].what);
  TF_RETURN_IF_ERROR(CheckSessions(acknowledged, begun, store));
  TF_RETURN_IF_ERROR(CheckMeshes(acknowledged, begun, store));
  TF_RETURN_IF_ERROR(CheckPredictions(acknowledged, begun, store));
  TF_RETURN_IF_ERROR(CheckCases(acknowledged, begun, store));
  return CheckUploads(acknowledged, begun, store);
}

absl::Status CheckErased(const StoreModel& acknowledged, const std::string& folder) {
  for (const char* suffix : {"", "-wal"}) {
    std::ifstream stream(folder + "/tissueform.db" + suffix, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(stream),
                            std::istreambuf_iterator<char>()};
    for (const std::string& text : acknowledged.erased) {
      if (absl::StrContains(bytes, text)) return Differs(absl::StrCat("deleted ", text));
    }
  }
  for (const std::string& name : acknowledged.erased_blobs) {
    for (const char* place : {"/blobs/", "/uploads/"}) {
      if (std::filesystem::exists(absl::StrCat(folder, place, name))) {
        return Differs(absl::StrCat("deleted file ", name));
      }
    }
  }
  return absl::OkStatus();
}

}  // namespace tissueform
