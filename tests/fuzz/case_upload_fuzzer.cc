// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cstdlib>
#include <memory>
#include <optional>
#include <string>

#include "spdlog/spdlog.h"

#include "core/mesh/payload/sha256.h"
#include "server/rpc/case_service.h"
#include "tests/fuzz/byte_source.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/rpc_rig.h"
#include "tests/testing/fake_calls.h"
#include "tests/testing/in_memory_stores.h"
#include "tests/testing/no_logins.h"

namespace tissueform::fuzz {
namespace {

using Upload = testing::FakeReaderCall<v1::UploadCaseRequest>;
using Download = testing::FakeWriterCall<v1::ReadCaseResponse>;

constexpr int kMaxCaseActions = 64;
// In a fuzzer's message it stands for a case that is kept.
constexpr char kOwnCase[] = "cases/own";

// CaseService without sockets, with room for a few small cases.
struct CaseRig {
  CaseRig() { spdlog::set_level(spdlog::level::off); }

  ServiceLimits limits{.max_case_bytes = 64 << 10, .max_cases = 3};
  AdmissionControl gate;
  InMemoryCaseStore store;
  WorkerPool workers{2};
  DeadlineTimer timer;
  testing::NoLogins no_logins;
  CaseService service{&gate, limits, &no_logins.access, &store, &workers, &timer};
  WorkerPool reactions{2};
};

// Damaged bytes are the client's to send again; other codes are those of all services.
void CheckCaseEnd(const std::optional<grpc::Status>& status) {
  if (status.has_value() && status->error_code() == grpc::StatusCode::DATA_LOSS) return;
  CheckEnd(status);
}

// One UploadCase call, which ends at the latest with this object.
class Sender {
 public:
  explicit Sender(CaseRig* rig) : call_(&rig->reactions) {
    call_.Bind(rig->service.UploadCase(nullptr, &response_));
  }
  ~Sender() {
    call_.CloseSending();
    const std::optional<grpc::Status> status = call_.WaitUntilDone();
    CheckCaseEnd(status);
    if (status->ok() && response_.case_().total_bytes() <= 0) std::abort();
  }
  Sender(const Sender&) = delete;
  Sender& operator=(const Sender&) = delete;

  void Send(const v1::UploadCaseRequest& request) { call_.Send(request); }
  void Cancel() { call_.Cancel(); }

 private:
  v1::UploadCaseResponse response_;
  Upload call_;
};

// What is kept is what its name says.
void CheckKept(CaseRig* rig) {
  const absl::StatusOr<CaseStore::Page> page = rig->store.List({});
  if (!page.ok() || page->records.size() > 3) std::abort();
  for (const CaseRecord& record : page->records) {
    const auto reader = rig->store.Open(record.key(), 0);
    if (!reader.ok()) continue;  // deleted just now
    const auto bytes = (*reader)->Read(0, record.total_bytes);
    if (!bytes.ok() || Sha256Hex({*bytes}) != record.sha256) std::abort();
  }
}

void Read(CaseRig* rig, v1::ReadCaseRequest request) {
  const absl::StatusOr<CaseStore::Page> page = rig->store.List({});
  if (request.name() == kOwnCase && page.ok() && !page->records.empty()) {
    request.set_name("cases/" + page->records[0].sha256);
  }
  Download call(&rig->reactions);
  call.Bind(rig->service.ReadCase(nullptr, &request));
  int64_t next = request.read_offset();
  while (const auto part = call.Receive()) {
    if (part->offset() != next || part->data().empty()) std::abort();
    next += static_cast<int64_t>(part->data().size());
    if (next > part->total_bytes()) std::abort();
  }
  CheckCaseEnd(call.WaitUntilDone());
}

// A case of these bytes, sent as it should be, but for what `damage` says.
void SendWhole(absl::string_view bytes, uint8_t damage, Sender* sender) {
  v1::UploadCaseRequest request;
  request.mutable_header()->set_sha256(Sha256Hex({bytes}));
  request.mutable_header()->set_total_bytes(static_cast<int64_t>(bytes.size()) + damage % 3);
  sender->Send(request);
  request.mutable_chunk()->set_data(bytes.data(), bytes.size());
  request.mutable_chunk()->set_finish_write(damage % 5 != 4);
  sender->Send(request);
}

class CasePlay {
 public:
  explicit CasePlay(CaseRig* rig) : rig_(rig), sender_(std::make_unique<Sender>(rig)) {}

  void Act(int action, absl::string_view bytes) {
    const auto size = static_cast<int>(bytes.size());
    if (action == 0) {
      sender_.reset();
      sender_ = std::make_unique<Sender>(rig_);
    } else if (action == 1) {
      sender_->Cancel();
    } else if (action == 2 && !bytes.empty()) {
      SendWhole(bytes.substr(1), static_cast<uint8_t>(bytes[0]), sender_.get());
    } else if (action == 3) {
      if (v1::ReadCaseRequest request; request.ParseFromArray(bytes.data(), size)) {
        Read(rig_, request);
      }
    } else if (v1::UploadCaseRequest request; request.ParseFromArray(bytes.data(), size)) {
      sender_->Send(request);
    }
  }

 private:
  CaseRig* const rig_;
  std::unique_ptr<Sender> sender_;
};

}  // namespace

void FuzzCaseUpload(const uint8_t* data, size_t size) {
  // As the rig of FuzzDeformStream; inputs leave no cases in it.
  static auto* const rig = new CaseRig();
  {
    ByteSource source(data, size);
    CasePlay play(rig);
    for (int i = 0; i < kMaxCaseActions && source.left() > 0; ++i) {
      const int action = source.Take<uint8_t>() % 8;
      const size_t count = source.Take<uint16_t>();
      play.Act(action, source.TakeBytes(count));
    }
  }
  CheckKept(rig);
  if (!rig->store.RemoveUnused(INT64_MAX, {}, 100).ok()) std::abort();
}

}  // namespace tissueform::fuzz
