// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/access/observed_stores.h"

#include <limits>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr int kPageSize = 1000;

class WatchedSessions final : public SessionStore {
 public:
  WatchedSessions(SessionStore* store, AccessChanges* changes)
      : store_(*store), changes_(*changes) {}

  void Create(SessionRecord record, int64_t epoch, RecordCallback done) override {
    store_.Create(std::move(record), epoch, Telling(std::move(done)));
  }
  void Get(const std::string& id, RecordCallback done) override { store_.Get(id, std::move(done)); }
  void Peek(const std::string& id, RecordCallback done) override {
    store_.Peek(id, std::move(done));
  }
  void Update(SessionRecord record, int64_t epoch, RecordCallback done) override {
    store_.Update(std::move(record), epoch, Telling(std::move(done)));
  }
  void CommitPoses(const std::string& id, std::vector<HandlePose> poses, int64_t epoch,
                   StatusCallback done) override {
    store_.CommitPoses(id, std::move(poses), epoch, std::move(done));
  }
  void Delete(const std::string& id, const std::string& etag, int64_t epoch,
              StatusCallback done) override {
    store_.Delete(id, etag, epoch, [this, id, done = std::move(done)](const absl::Status& status) {
      if (status.ok() || absl::IsNotFound(status)) changes_.SessionRemoved(id);
      done(status);
    });
  }
  void List(const ListRequest& request, PageCallback done) override {
    if (request.owner.has_value()) {
      store_.List(request, std::move(done));
      return;
    }
    store_.List(request, [this, done = std::move(done)](absl::StatusOr<Page> page) {
      if (page.ok()) {
        for (const SessionRecord& record : page->records) changes_.Added(record);
      }
      done(std::move(page));
    });
  }
  void Touch(std::vector<std::string> ids, int64_t now_s, StatusCallback done) override {
    store_.Touch(std::move(ids), now_s, std::move(done));
  }
  void ListUnused(int64_t before_s, int limit, PageCallback done) override {
    store_.ListUnused(before_s, limit, std::move(done));
  }

 private:
  RecordCallback Telling(RecordCallback done) {
    return [this, done = std::move(done)](absl::StatusOr<SessionRecord> record) {
      if (record.ok()) changes_.Added(*record);
      done(std::move(record));
    };
  }

  SessionStore& store_;
  AccessChanges& changes_;
};

class WatchedPredictions final : public PredictionStore {
 public:
  WatchedPredictions(PredictionStore* store, AccessChanges* changes)
      : store_(*store), changes_(*changes) {}

  absl::Status Create(const PredictionRecord& record, const std::string& positions) override {
    TF_RETURN_IF_ERROR(store_.Create(record, positions));
    changes_.Added(record);
    return absl::OkStatus();
  }
  absl::StatusOr<PredictionRecord> Get(const std::string& id) override { return store_.Get(id); }
  absl::StatusOr<std::string> Positions(const std::string& id) override {
    return store_.Positions(id);
  }
  absl::StatusOr<Page> List(const ListRequest& request) override { return store_.List(request); }
  absl::Status Delete(const std::string& id) override {
    TF_RETURN_IF_ERROR(store_.Delete(id));
    changes_.PredictionRemoved(id);
    return absl::OkStatus();
  }

 private:
  PredictionStore& store_;
  AccessChanges& changes_;
};

// Ends as the writer that it holds.
class WatchedCaseWriter final : public CaseWriter {
 public:
  WatchedCaseWriter(CaseRecord record, std::unique_ptr<CaseWriter> writer, AccessChanges* changes)
      : CaseWriter(std::move(record)), writer_(std::move(writer)), changes_(*changes) {}

 protected:
  absl::Status Append(absl::string_view bytes) override {
    TF_RETURN_IF_ERROR(writer_->Write(offset_, bytes));
    offset_ += static_cast<int64_t>(bytes.size());
    return absl::OkStatus();
  }
  absl::StatusOr<CaseRecord> Keep() override {
    TF_ASSIGN_OR_RETURN(CaseRecord kept, writer_->Finish());
    changes_.Added(kept);
    return kept;
  }

 private:
  const std::unique_ptr<CaseWriter> writer_;
  AccessChanges& changes_;
  int64_t offset_ = 0;
};

class WatchedCases final : public CaseStore {
 public:
  WatchedCases(CaseStore* store, AccessChanges* changes) : store_(*store), changes_(*changes) {}

  absl::StatusOr<std::unique_ptr<CaseWriter>> Begin(CaseRecord record, int most) override {
    TF_ASSIGN_OR_RETURN(std::unique_ptr<CaseWriter> writer, store_.Begin(record, most));
    return std::make_unique<WatchedCaseWriter>(std::move(record), std::move(writer), &changes_);
  }
  absl::StatusOr<CaseRecord> Find(const CaseKey& key) override { return store_.Find(key); }
  absl::StatusOr<std::unique_ptr<CaseReader>> Open(const CaseKey& key, int64_t now_s) override {
    return store_.Open(key, now_s);
  }
  absl::StatusOr<Page> List(const ListRequest& request) override { return store_.List(request); }
  absl::Status Delete(const CaseKey& key) override {
    TF_RETURN_IF_ERROR(store_.Delete(key));
    changes_.CaseRemoved(key);
    return absl::OkStatus();
  }
  absl::Status Touch(const CaseKey& key, int64_t now_s) override {
    return store_.Touch(key, now_s);
  }
  absl::StatusOr<std::vector<CaseKey>> RemoveUnused(int64_t before_s,
                                                    const std::set<std::string>& spared,
                                                    int most) override {
    TF_ASSIGN_OR_RETURN(std::vector<CaseKey> removed, store_.RemoveUnused(before_s, spared, most));
    for (const CaseKey& key : removed) changes_.CaseRemoved(key);
    return removed;
  }

 private:
  CaseStore& store_;
  AccessChanges& changes_;
};

class WatchedStores final : public Stores {
 public:
  WatchedStores(std::unique_ptr<Stores> stores, AccessChanges* changes)
      : sessions_(&stores->sessions(), changes),
        predictions_(&stores->predictions(), changes),
        cases_(&stores->cases(), changes),
        stores_(std::move(stores)) {}

  SessionStore& sessions() override { return sessions_; }
  MeshStore& meshes() override { return stores_->meshes(); }
  UploadStore& uploads() override { return stores_->uploads(); }
  PredictionStore& predictions() override { return predictions_; }
  CaseStore& cases() override { return cases_; }
  SqlDatabase& database() override { return stores_->database(); }
  bool keeps() const override { return stores_->keeps(); }
  int64_t NowS() const override { return stores_->NowS(); }
  absl::Status AskTime() override { return stores_->AskTime(); }
  const DurationHistogram* latency() const override { return stores_->latency(); }
  std::string folder() const override { return stores_->folder(); }

 private:
  WatchedSessions sessions_;
  WatchedPredictions predictions_;
  WatchedCases cases_;
  const std::unique_ptr<Stores> stores_;  // last: its end answers what the others were asked
};

}  // namespace

std::unique_ptr<Stores> WatchStores(std::unique_ptr<Stores> stores, AccessChanges* changes) {
  return std::make_unique<WatchedStores>(std::move(stores), changes);
}

absl::Status NotifyExisting(Stores* stores, AccessChanges* changes) {
  PredictionStore::ListRequest predictions{.limit = kPageSize};
  do {
    TF_ASSIGN_OR_RETURN(PredictionStore::Page page, stores->predictions().List(predictions));
    for (const PredictionRecord& record : page.records) changes->Added(record);
    predictions.after = std::move(page.next);
  } while (!predictions.after.empty());
  // All cases at once: those of one name may not be parted.
  TF_ASSIGN_OR_RETURN(const CaseStore::Page cases,
                      stores->cases().List({.limit = std::numeric_limits<int>::max()}));
  for (const CaseRecord& record : cases.records) changes->Added(record);
  return absl::OkStatus();
}

}  // namespace tissueform
