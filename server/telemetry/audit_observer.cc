// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/telemetry/audit_observer.h"

#include <utility>

#include "absl/strings/string_view.h"
#include "nlohmann/json.hpp"

#include "core/base/error_reason.h"
#include "server/telemetry/rpc_table.h"

namespace tissueform {
namespace {

// With all escapes an event stays below 8192 bytes, which collectors take as a rule (RFC 5425).
constexpr size_t kMaxOfAName = 256;

using Json = nlohmann::ordered_json;

std::set<std::string, std::less<>> StreamNames() {
  std::set<std::string, std::less<>> names;
  for (Rpc& rpc : AllRpcs()) {
    if (rpc.streams) names.insert(std::move(rpc.name));
  }
  return names;
}

Json Event(const char* event, absl::Time now) {
  return {{"event", event},
          {"time", absl::FormatTime("%Y-%m-%d%ET%H:%M:%E6SZ", now, absl::UTCTimeZone())}};
}

Json CallEvent(const char* event, absl::Time now, const ObservedCall& call) {
  Json line = Event(event, now);
  line["principal"] = call.principal.name.substr(0, kMaxOfAName);
  line["rpc"] = call.method;
  line["resource"] = call.resource.substr(0, kMaxOfAName);
  line["address"] = call.address.substr(0, kMaxOfAName);
  line["request_id"] = call.request_id.substr(0, kMaxOfAName);
  return line;
}

void AddOutcome(const absl::Status& outcome, std::chrono::steady_clock::duration elapsed,
                Json* line) {
  (*line)["code"] = absl::StatusCodeToString(outcome.code());
  if (!outcome.ok()) (*line)["reason"] = ReasonOf(outcome);
  (*line)["duration_ms"] = std::chrono::duration_cast<std::chrono::milliseconds>(elapsed).count();
}

std::string TextOf(const Json& line) {
  return line.dump(-1, ' ', /*ensure_ascii=*/true, Json::error_handler_t::replace);
}

}  // namespace

std::string AuditObserver::LostEvent(int64_t count) {
  Json line = Event("lost", absl::Now());
  line["count"] = count;
  return TextOf(line);
}

AuditObserver::AuditObserver(AuditLog* log, std::function<absl::Time()> now)
    : log_(log),
      now_(std::move(now)),
      left_out_({"ServerInfoService.GetServerInfo", "AccessService.WhoAmI",
                 "DeformService.AcknowledgeWatch"}),
      streams_(StreamNames()) {}

AuditObserver::~AuditObserver() {
  MutexLock lock(mutex_);
  WriteSkippedRefusals(now_());
}

absl::Status AuditObserver::OnBegin(const ObservedCall& call) {
  if (IsLeftOut(call.method)) return absl::OkStatus();
  const bool streams = IsStream(call.method);
  absl::Status reserved = log_->Reserve(streams ? 2 : 1);
  if (reserved.ok() && streams) log_->Write(TextOf(CallEvent("open", now_(), call)));
  return reserved;
}

void AuditObserver::OnResource(const ObservedCall& call) {
  // Of other calls the end, which comes at once, has it.
  if (!call.served || !IsStream(call.method) || IsLeftOut(call.method)) return;
  log_->WriteIfRoom(TextOf(CallEvent("use", now_(), call)));
}

void AuditObserver::OnEnd(const ObservedCall& call, const absl::Status& outcome,
                          std::chrono::steady_clock::duration elapsed) {
  if (IsLeftOut(call.method)) return;
  if (!call.served && !MayWriteRefusal()) return;
  const char* const event = !call.served ? "refused" : IsStream(call.method) ? "close" : "call";
  Json line = CallEvent(event, now_(), call);
  AddOutcome(outcome, elapsed, &line);
  if (call.served) {
    log_->Write(TextOf(line));
  } else {
    log_->WriteIfRoom(TextOf(line));
  }
}

bool AuditObserver::MayWriteRefusal() {
  const absl::Time now = now_();
  MutexLock lock(mutex_);
  if (const int64_t second = absl::ToUnixSeconds(now); second != second_) {
    WriteSkippedRefusals(now);
    second_ = second;
    written_ = 0;
  }
  if (written_ < kRefusedLinesASecond) {
    ++written_;
    return true;
  }
  ++skipped_;
  return false;
}

void AuditObserver::WriteSkippedRefusals(absl::Time now) {
  if (skipped_ == 0) return;
  Json line = Event("refused_more", now);
  line["count"] = std::exchange(skipped_, 0);
  log_->WriteIfRoom(TextOf(line));
}

}  // namespace tissueform
