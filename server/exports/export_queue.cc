// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/exports/export_queue.h"

#include <algorithm>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "core/base/error_reason.h"
#include "core/base/random_id.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

// Digits of an id that count, so that ids rise; the rest is random.
constexpr int kCountedDigits = 12;

absl::Status TooManyExports(absl::string_view what, int limit, absl::string_view option) {
  return WithReason(
      absl::ResourceExhaustedError(absl::StrCat(what, " ", limit, " exports, which is the limit; ",
                                                "wait, withdraw some or raise ", option)),
      ErrorReason::kTooManyExports, {{"limit", absl::StrCat(limit)}});
}

// Takes the id out of the set of `key`, and that with its last one.
void EraseFrom(std::map<std::string, std::set<std::string>>* ids, const std::string& key,
               const std::string& id) {
  const auto found = ids->find(key);
  found->second.erase(id);
  if (found->second.empty()) ids->erase(found);
}

}  // namespace

std::string ExportQueue::EtagOf(const ExportRecord& record) { return absl::StrCat(record.version); }

absl::Status ExportQueue::LoadAll(const std::function<bool(const std::string&)>& is_there) {
  TF_ASSIGN_OR_RETURN(const std::vector<ExportRecord> kept, store_.Load());
  MutexLock writing(writing_);
  std::vector<std::string> orphans;
  for (const ExportRecord& record : kept) {
    if (!is_there(record.prediction)) {
      orphans.push_back(record.id);
      continue;
    }
    MutexLock lock(mutex_);
    Index(record);
  }
  return orphans.empty() ? absl::OkStatus() : store_.Erase(orphans);
}

absl::Status ExportQueue::ReloadRows() {
  MutexLock writing(writing_);
  return Refresh();
}

absl::Status ExportQueue::Refresh() {
  TF_ASSIGN_OR_RETURN(const std::vector<ExportRecord> kept, store_.Load());
  std::vector<ExportRecord> changed;
  std::set<std::string> gone;
  {
    MutexLock lock(mutex_);
    for (const auto& [id, record] : records_) gone.insert(id);
    for (const ExportRecord& record : kept) {
      gone.erase(record.id);
      const auto known = records_.find(record.id);
      if (known == records_.end() || known->second != record) changed.push_back(record);
    }
  }
  Drop({gone.begin(), gone.end()});
  for (const ExportRecord& record : changed) Take(record);
  return absl::OkStatus();
}

const ExportRecord* ExportQueue::FindEarlier(const ExportRecord& wanted) const {
  if (!wanted.request_key.empty()) {
    const auto same = of_request_.find(wanted.request_key);
    if (same != of_request_.end()) return &records_.at(same->second);
  }
  const auto others = of_prediction_.find(wanted.prediction);
  if (others == of_prediction_.end()) return nullptr;
  for (const std::string& id : others->second) {
    const ExportRecord& record = records_.at(id);
    if (!IsDone(record.state)) return &record;
  }
  return nullptr;
}

absl::Status ExportQueue::CheckRoom(const std::string& owner) const {
  if (records_.size() >= static_cast<size_t>(limits_.max_kept)) {
    return TooManyExports("the server keeps", limits_.max_kept, "--max-exports");
  }
  int waiting = 0;
  int own = 0;
  for (const auto& [id, record] : records_) {
    if (IsDone(record.state)) continue;
    ++waiting;
    own += record.owner == owner ? 1 : 0;
  }
  if (waiting >= limits_.max_waiting) {
    return TooManyExports("on this server wait", limits_.max_waiting, "--max-waiting-exports");
  }
  if (!owner.empty() && own >= limits_.max_waiting_of_principal) {
    return TooManyExports("of yours wait", limits_.max_waiting_of_principal, "--quota-exports");
  }
  return absl::OkStatus();
}

std::string ExportQueue::NewId() {
  uint64_t number = static_cast<uint64_t>(clock_()) << 16;
  uint64_t last = 0;
  if (!records_.empty() &&
      absl::SimpleHexAtoi(records_.rbegin()->first.substr(0, kCountedDigits), &last)) {
    number = std::max(number, last + 1);  // a clock may go back
  }
  return absl::StrFormat("%0*x-%s", kCountedDigits, number, RandomId());
}

absl::StatusOr<ExportRecord> ExportQueue::Create(ExportRecord wanted) {
  MutexLock writing(writing_);
  // Another server may have had the same request.
  if (read_gate_) TF_RETURN_IF_ERROR(Refresh());
  {
    MutexLock lock(mutex_);
    if (const ExportRecord* earlier = FindEarlier(wanted); earlier != nullptr) {
      if (!wanted.request_key.empty() && earlier->request_key == wanted.request_key &&
          earlier->request_fingerprint != wanted.request_fingerprint) {
        return WithReason(
            absl::InvalidArgumentError("request_id was used for another request; choose a new one"),
            ErrorReason::kRequestIdReused);
      }
      return *earlier;
    }
    TF_RETURN_IF_ERROR(CheckRoom(wanted.owner));
    wanted.id = NewId();
  }
  wanted.state = ExportState::kWaiting;
  wanted.created_s = wanted.updated_s = clock_();
  wanted.version = 1;
  wanted.change = RandomId();
  TF_RETURN_IF_ERROR(Keep(wanted));
  return wanted;
}

absl::Status ExportQueue::Keep(const ExportRecord& record) {
  TF_RETURN_IF_ERROR(store_.Put(record));
  Take(record);
  return absl::OkStatus();
}

void ExportQueue::Index(const ExportRecord& record) {
  records_[record.id] = record;
  of_prediction_[record.prediction].insert(record.id);
  of_case_[record.case_sha256].insert(record.id);
  if (!record.request_key.empty()) of_request_[record.request_key] = record.id;
}

void ExportQueue::Take(const ExportRecord& record) {
  {
    MutexLock lock(mutex_);
    Index(record);
  }
  on_changed_(record);
}

absl::StatusOr<ExportRecord> ExportQueue::FindOrRead(const std::string& id) {
  absl::StatusOr<ExportRecord> found = Find(id);
  if (found.ok() || !read_gate_) return found;
  TF_RETURN_IF_ERROR(read_gate_(id, [this] { return ReloadRows(); }));
  return Find(id);
}

absl::StatusOr<ExportRecord> ExportQueue::Find(const std::string& id) const {
  MutexLock lock(mutex_);
  const auto found = records_.find(id);
  if (found == records_.end()) return NoExport(id);
  return found->second;
}

ExportQueue::Page ExportQueue::List(const ListRequest& request) const {
  Page page;
  MutexLock lock(mutex_);
  for (auto next = records_.upper_bound(request.after); next != records_.end(); ++next) {
    const ExportRecord& record = next->second;
    if (request.owner.has_value() && record.owner != *request.owner) continue;
    if (request.prediction.has_value() && record.prediction != *request.prediction) continue;
    if (request.case_sha256.has_value() && record.case_sha256 != *request.case_sha256) continue;
    if (page.records.size() == static_cast<size_t>(request.limit)) {
      page.next = page.records.back().id;
      break;
    }
    page.records.push_back(record);
  }
  return page;
}

std::set<std::string> ExportQueue::Waiting(const std::optional<std::string>& owner) const {
  std::set<std::string> ids;
  MutexLock lock(mutex_);
  for (const auto& [id, record] : records_) {
    if (!IsDone(record.state) && (!owner.has_value() || record.owner == *owner)) ids.insert(id);
  }
  return ids;
}

int ExportQueue::CountWaiting() const { return static_cast<int>(Waiting(std::nullopt).size()); }

bool ExportQueue::IsExported(const std::string& prediction) const {
  MutexLock lock(mutex_);
  return of_prediction_.contains(prediction);
}

std::set<std::string> ExportQueue::Exported() const {
  std::set<std::string> predictions;
  MutexLock lock(mutex_);
  for (const auto& [prediction, ids] : of_prediction_) predictions.insert(prediction);
  return predictions;
}

std::set<std::string> ExportQueue::ExportedCases() const {
  std::set<std::string> cases;
  MutexLock lock(mutex_);
  for (const auto& [case_sha256, ids] : of_case_) cases.insert(case_sha256);
  return cases;
}

std::set<std::string> ExportQueue::ExportedOfCase(const std::string& case_sha256) const {
  std::set<std::string> predictions;
  MutexLock lock(mutex_);
  const auto found = of_case_.find(case_sha256);
  if (found == of_case_.end()) return predictions;
  for (const std::string& id : found->second) predictions.insert(records_.at(id).prediction);
  return predictions;
}

absl::StatusOr<ExportRecord> ExportQueue::Update(const std::string& id, const Change& change) {
  MutexLock writing(writing_);
  TF_ASSIGN_OR_RETURN(ExportRecord record, Find(id));
  if (!change.etag.empty() && change.etag != EtagOf(record)) return StaleExport(id);
  if (!MayFollow(record.state, change.state)) {
    return absl::InvalidArgumentError(
        "invalid change of state; states go from waiting over confirmation and "
        "storing, which may go back to confirmation, to stored or failed, and stays there");
  }
  record.state = change.state;
  record.detail = change.detail;
  record.stored_objects = change.stored_objects;
  record.updated_s = clock_();
  ++record.version;
  record.change = RandomId();
  const absl::Status kept = Keep(record);
  // Another server was faster: who tries again sees what it has done.
  if (absl::IsAborted(kept)) Refresh().IgnoreError();
  TF_RETURN_IF_ERROR(kept);
  return record;
}

absl::Status ExportQueue::Remove(const std::string& id) {
  MutexLock writing(writing_);
  TF_RETURN_IF_ERROR(Find(id).status());
  return Erase({id});
}

absl::Status ExportQueue::RemoveOf(const std::string& prediction) {
  MutexLock writing(writing_);
  std::vector<std::string> ids;
  {
    MutexLock lock(mutex_);
    const auto found = of_prediction_.find(prediction);
    if (found == of_prediction_.end()) return absl::OkStatus();
    ids.assign(found->second.begin(), found->second.end());
  }
  return Erase(ids);
}

absl::StatusOr<int> ExportQueue::RemoveUnchanged(int64_t before_s, int most) {
  MutexLock writing(writing_);
  std::vector<std::string> ids;
  {
    MutexLock lock(mutex_);
    for (const auto& [id, record] : records_) {
      if (ids.size() == static_cast<size_t>(most)) break;
      if (record.updated_s < before_s) ids.push_back(id);
    }
  }
  if (!ids.empty()) TF_RETURN_IF_ERROR(Erase(ids));
  return static_cast<int>(ids.size());
}

absl::Status ExportQueue::Erase(const std::vector<std::string>& ids) {
  Drop(ids);
  return store_.Erase(ids);
}

void ExportQueue::Drop(const std::vector<std::string>& ids) {
  // From memory at once: a withdrawn export grants no access, regardless of what the disk says.
  MutexLock lock(mutex_);
  for (const std::string& id : ids) {
    const auto found = records_.find(id);
    const ExportRecord record = std::move(found->second);
    records_.erase(found);
    of_request_.erase(record.request_key);
    EraseFrom(&of_prediction_, record.prediction, id);
    EraseFrom(&of_case_, record.case_sha256, id);
  }
}

}  // namespace tissueform
