// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/in_memory_case_store.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "server/store/store_errors.h"

namespace tissueform {

class InMemoryCaseStore::Writer final : public CaseWriter {
 public:
  Writer(CaseRecord record, int most, InMemoryCaseStore* store)
      : CaseWriter(std::move(record)), most_(most), store_(store) {}
  ~Writer() override { store_->Release(reserved_bytes_); }

 protected:
  absl::Status Append(absl::string_view bytes) override {
    TF_RETURN_IF_ERROR(store_->Reserve(static_cast<int64_t>(bytes.size())));
    reserved_bytes_ += static_cast<int64_t>(bytes.size());
    bytes_.Append(bytes);
    return absl::OkStatus();
  }
  absl::StatusOr<CaseRecord> Keep() override {
    bool taken = false;
    absl::StatusOr<CaseRecord> kept = store_->Keep(record(), bytes_, most_, &taken);
    if (taken) reserved_bytes_ = 0;
    return kept;
  }

 private:
  const int most_;
  InMemoryCaseStore* const store_;
  absl::Cord bytes_;
  int64_t reserved_bytes_ = 0;
};

class InMemoryCaseStore::Reader final : public CaseReader {
 public:
  explicit Reader(const Case& opened)
      : CaseReader(opened.record.sha256, opened.record.total_bytes), bytes_(opened.bytes) {}

 protected:
  absl::StatusOr<std::string> ReadAt(int64_t offset, int64_t size) override {
    return std::string(bytes_.Subcord(static_cast<size_t>(offset), static_cast<size_t>(size)));
  }
  absl::Status SetAside(const absl::Status& damage) override { return damage; }

 private:
  const absl::Cord bytes_;
};

absl::Status InMemoryCaseStore::Reserve(int64_t bytes) {
  MutexLock lock(mutex_);
  if (bytes_ + bytes > most_bytes_) {
    return absl::ResourceExhaustedError(
        absl::StrCat("the cases of a server with --in-memory are limited to ", most_bytes_ >> 20,
                     " MiB together; delete some, or run the server with --data-dir"));
  }
  bytes_ += bytes;
  return absl::OkStatus();
}

void InMemoryCaseStore::Release(int64_t bytes) {
  MutexLock lock(mutex_);
  bytes_ -= bytes;
}

absl::StatusOr<CaseRecord> InMemoryCaseStore::Keep(const CaseRecord& record,
                                                   const absl::Cord& bytes, int most, bool* taken) {
  MutexLock lock(mutex_);
  const auto found = cases_.find(record.key());
  if (found != cases_.end()) {
    int64_t& last_used_s = found->second.record.last_used_s;
    last_used_s = std::max(last_used_s, record.last_used_s);
    return found->second.record;
  }
  if (cases_.size() >= static_cast<size_t>(most)) return TooManyCases(most);
  cases_.emplace(record.key(), Case{record, bytes});
  *taken = true;
  return record;
}

absl::StatusOr<std::unique_ptr<CaseWriter>> InMemoryCaseStore::Begin(CaseRecord record, int most) {
  TF_RETURN_IF_ERROR(CheckCaseRecord(record));
  MutexLock lock(mutex_);
  if (cases_.size() >= static_cast<size_t>(most)) return TooManyCases(most);
  return std::make_unique<Writer>(std::move(record), most, this);
}

absl::StatusOr<CaseRecord> InMemoryCaseStore::Find(const CaseKey& key) {
  MutexLock lock(mutex_);
  const auto found = cases_.find(key);
  if (found == cases_.end()) return NoCase(key.sha256);
  return found->second.record;
}

absl::StatusOr<std::unique_ptr<CaseReader>> InMemoryCaseStore::Open(const CaseKey& key,
                                                                    int64_t now_s) {
  TF_RETURN_IF_ERROR(Touch(key, now_s));
  MutexLock lock(mutex_);
  const auto found = cases_.find(key);
  if (found == cases_.end()) return NoCase(key.sha256);
  return std::make_unique<Reader>(found->second);
}

absl::StatusOr<CaseStore::Page> InMemoryCaseStore::List(const ListRequest& request) {
  if (request.limit < 1) return BadLimit(request.limit);
  Page page;
  MutexLock lock(mutex_);
  for (auto next = cases_.lower_bound({.sha256 = request.after}); next != cases_.end(); ++next) {
    const CaseRecord& record = next->second.record;
    if (record.sha256 == request.after) continue;
    const bool wanted = !request.owner.has_value() || record.owner == *request.owner ||
                        request.also.contains(next->first);
    if (!wanted) continue;
    if (page.records.size() == static_cast<size_t>(request.limit)) {
      page.next = page.records.back().sha256;
      break;
    }
    page.records.push_back(record);
  }
  return page;
}

absl::Status InMemoryCaseStore::Delete(const CaseKey& key) {
  MutexLock lock(mutex_);
  const auto found = cases_.find(key);
  if (found == cases_.end()) return NoCase(key.sha256);
  bytes_ -= found->second.record.total_bytes;
  cases_.erase(found);
  return absl::OkStatus();
}

absl::Status InMemoryCaseStore::Touch(const CaseKey& key, int64_t now_s) {
  MutexLock lock(mutex_);
  if (const auto found = cases_.find(key); found != cases_.end()) {
    int64_t& last_used_s = found->second.record.last_used_s;
    last_used_s = std::max(last_used_s, now_s);
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<CaseKey>> InMemoryCaseStore::RemoveUnused(
    int64_t before_s, const std::set<std::string>& spared, int most) {
  MutexLock lock(mutex_);
  std::vector<std::pair<int64_t, CaseKey>> unused;
  for (const auto& [key, kept] : cases_) {
    if (kept.record.last_used_s < before_s && !spared.contains(key.sha256)) {
      unused.emplace_back(kept.record.last_used_s, key);
    }
  }
  std::sort(unused.begin(), unused.end());
  if (unused.size() > static_cast<size_t>(most)) unused.resize(static_cast<size_t>(most));
  std::vector<CaseKey> removed;
  for (auto& [last_used_s, key] : unused) {
    const auto found = cases_.find(key);
    bytes_ -= found->second.record.total_bytes;
    cases_.erase(found);
    removed.push_back(std::move(key));
  }
  return removed;
}

}  // namespace tissueform
