// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/case_upload_stream.h"

#include <chrono>
#include <cstdint>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mesh/payload/sha256.h"
#include "server/rpc/case_service.h"
#include "tests/testing/fake_calls.h"
#include "tests/testing/in_memory_stores.h"
#include "tests/testing/no_logins.h"
#include "tests/testing/status_matchers.h"

// Without sockets: reactions come from threads that ThreadSanitizer sees through.
namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using Code = grpc::StatusCode;

constexpr int kStoreWorkers = 2;

struct CaseCall {
  CaseCall(WorkerPool* reactions, CaseService* service) : call(reactions) {
    call.Bind(service->UploadCase(nullptr, &response));
  }
  // True when the call ends with this code; well only once the client has said all.
  bool EndsWith(Code code) {
    if (code == Code::OK) call.CloseSending();
    const std::optional<grpc::Status> status = call.WaitUntilDone();
    EXPECT_TRUE(status.has_value()) << "it waits for ever";
    if (!status.has_value()) return false;
    message = status->error_message();
    EXPECT_EQ(status->error_code(), code) << message;
    return status->error_code() == code;
  }

  v1::UploadCaseResponse response;
  std::string message;
  FakeReaderCall<v1::UploadCaseRequest> call;
};

class CaseUploadStreamTest : public ::testing::Test {
 protected:
  ~CaseUploadStreamTest() override {
    reactions_.reset();
    workers_.reset();
  }

  static std::string Sample(size_t bytes) {
    std::string sample(bytes, '\0');
    for (size_t i = 0; i < bytes; ++i) sample[i] = static_cast<char>(i * i % 251);
    return sample;
  }
  static v1::UploadCaseRequest HeaderOf(const std::string& bytes,
                                        const std::string& title = "head") {
    v1::UploadCaseRequest request;
    request.mutable_header()->set_sha256(Sha256Hex({bytes}));
    request.mutable_header()->set_total_bytes(static_cast<int64_t>(bytes.size()));
    request.mutable_header()->set_title(title);
    return request;
  }
  v1::UploadCaseRequest Chunk(size_t offset, size_t size, bool finish = false) const {
    v1::UploadCaseRequest request;
    request.mutable_chunk()->set_write_offset(static_cast<int64_t>(offset));
    request.mutable_chunk()->set_data(bytes_.substr(offset, size));
    request.mutable_chunk()->set_finish_write(finish);
    return request;
  }
  std::unique_ptr<CaseCall> Begin() {
    auto upload = std::make_unique<CaseCall>(reactions_.get(), &service_);
    upload->call.Send(HeaderOf(bytes_));
    return upload;
  }
  // Sends the whole case and expects this end.
  void SendAll(Code code) {
    const std::unique_ptr<CaseCall> upload = Begin();
    upload->call.Send(Chunk(0, bytes_.size(), true));
    EXPECT_TRUE(upload->EndsWith(code));
  }
  bool Kept() { return store_.Find({sha256_}).ok(); }

  const std::string bytes_ = Sample(10'000);
  const std::string sha256_ = Sha256Hex({bytes_});
  ServiceLimits limits_{.max_case_bytes = 20'000, .max_cases = 2};
  AdmissionControl gate_;
  InMemoryCaseStore store_;
  std::unique_ptr<WorkerPool> workers_ = std::make_unique<WorkerPool>(kStoreWorkers);
  DeadlineTimer timer_;
  NoLogins no_logins_;
  CaseService service_{&gate_, limits_, &no_logins_.access, &store_, workers_.get(), &timer_};
  std::unique_ptr<WorkerPool> reactions_ = std::make_unique<WorkerPool>(4);
};

TEST_F(CaseUploadStreamTest, ChunksMakeACase) {
  const std::unique_ptr<CaseCall> upload = Begin();
  for (size_t offset = 0; offset < bytes_.size(); offset += 700) {
    upload->call.Send(Chunk(offset, 700, offset + 700 >= bytes_.size()));
  }
  ASSERT_TRUE(upload->EndsWith(Code::OK));
  EXPECT_FALSE(upload->response.already_existed());
  const v1::Case& made = upload->response.case_();
  EXPECT_EQ(made.name(), "cases/" + sha256_);
  EXPECT_EQ(made.title(), "head");
  EXPECT_EQ(made.total_bytes(), 10'000);
  EXPECT_GT(made.create_time().seconds(), 0);
  EXPECT_EQ(*(*store_.Open({sha256_}, 0))->Read(0, 10'000), bytes_);
}

TEST_F(CaseUploadStreamTest, AKnownCaseIsAnsweredWithoutItsChunks) {
  SendAll(Code::OK);
  const std::unique_ptr<CaseCall> again = Begin();
  EXPECT_TRUE(again->EndsWith(Code::OK));
  EXPECT_TRUE(again->response.already_existed());
  EXPECT_EQ(again->response.case_().name(), "cases/" + sha256_);
}

TEST_F(CaseUploadStreamTest, AnEndAtAnyChunkLeavesNothing) {
  for (const size_t sent : {size_t{0}, size_t{1}, size_t{5'000}, bytes_.size()}) {
    for (const bool cancelled : {false, true}) {
      const std::unique_ptr<CaseCall> upload = Begin();
      if (sent > 0) upload->call.Send(Chunk(0, sent));
      if (cancelled) {
        upload->call.Cancel();
        EXPECT_FALSE(upload->call.WaitUntilDone()->ok());
      } else {
        upload->call.CloseSending();
        EXPECT_TRUE(upload->EndsWith(Code::INVALID_ARGUMENT));
        EXPECT_THAT(upload->message, HasSubstr("finish_write"));
      }
      EXPECT_FALSE(Kept());
    }
  }
  SendAll(Code::OK);
}

TEST_F(CaseUploadStreamTest, RefusesInvalidUploads) {
  const auto refused = [&](const std::vector<v1::UploadCaseRequest>& messages, Code code,
                           const std::string& why) {
    CaseCall upload(reactions_.get(), &service_);
    for (const v1::UploadCaseRequest& message : messages) upload.call.Send(message);
    upload.call.CloseSending();
    EXPECT_TRUE(upload.EndsWith(code)) << why;
    EXPECT_THAT(upload.message, HasSubstr(why));
    EXPECT_FALSE(Kept());
  };
  const v1::UploadCaseRequest header = HeaderOf(bytes_);
  const auto changed = [&header](auto change) {
    v1::UploadCaseRequest request = header;
    change(*request.mutable_header());
    return std::vector<v1::UploadCaseRequest>{request};
  };
  refused({v1::UploadCaseRequest()}, Code::INVALID_ARGUMENT, "header");
  refused({Chunk(0, 10)}, Code::INVALID_ARGUMENT, "header");
  refused({header, header}, Code::INVALID_ARGUMENT, "only chunks");
  refused({header, Chunk(10, 10)}, Code::INVALID_ARGUMENT, "continue there");
  refused({header, Chunk(0, 5'000), Chunk(0, 5'000)}, Code::INVALID_ARGUMENT, "5000 bytes");
  refused({header, Chunk(0, 5'000, true)}, Code::INVALID_ARGUMENT, "send all");
  v1::UploadCaseRequest beyond = Chunk(9'000, 1'000, true);
  beyond.mutable_chunk()->mutable_data()->append("x");
  refused({header, Chunk(0, 9'000), beyond}, Code::INVALID_ARGUMENT, "ends at 10000");
  v1::UploadCaseRequest flipped = Chunk(0, 10'000, true);
  (*flipped.mutable_chunk()->mutable_data())[77] ^= 1;
  refused({header, flipped}, Code::DATA_LOSS, "damaged in transit");
  v1::UploadCaseRequest large = Chunk(0, 1);
  large.mutable_chunk()->mutable_data()->resize((1 << 20) + 1);
  refused({header, large}, Code::INVALID_ARGUMENT, "1048576");
  refused(changed([](v1::CaseHeader& to) { to.set_sha256("../../etc"); }), Code::INVALID_ARGUMENT,
          "SHA-256");
  refused(changed([](v1::CaseHeader& to) { to.set_total_bytes(0); }), Code::INVALID_ARGUMENT,
          "at least one");
  refused(changed([](v1::CaseHeader& to) { to.set_total_bytes(-1); }), Code::INVALID_ARGUMENT,
          "at least one");
  refused(changed([](v1::CaseHeader& to) { to.set_total_bytes(20'001); }), Code::RESOURCE_EXHAUSTED,
          "max_case_bytes");
  refused(changed([](v1::CaseHeader& to) { to.set_title(std::string(257, 'x')); }),
          Code::INVALID_ARGUMENT, "256");
  refused(changed([](v1::CaseHeader& to) { to.set_title("two\nlines"); }), Code::INVALID_ARGUMENT,
          "control");
  refused(changed([](v1::CaseHeader& to) {
            to.set_title(
                "a\xc2\x9b"
                "2J");
          }),
          Code::INVALID_ARGUMENT, "control");
}

TEST_F(CaseUploadStreamTest, AMessageNeverHoldsTheTitle) {
  CaseCall upload(reactions_.get(), &service_);
  upload.call.Send(HeaderOf(bytes_, "Jane\tDoe"));
  EXPECT_TRUE(upload.EndsWith(Code::INVALID_ARGUMENT));
  EXPECT_THAT(upload.message, Not(HasSubstr("Doe")));
}

TEST_F(CaseUploadStreamTest, MoreThanTheLimitOfCasesAreRefusedUntilOneGoes) {
  SendAll(Code::OK);
  const std::string other = Sample(100);
  for (const Code code : {Code::OK, Code::RESOURCE_EXHAUSTED, Code::OK}) {
    const std::string bytes = absl::StrCat(other, static_cast<int>(code), store_.List({})->next);
    CaseCall upload(reactions_.get(), &service_);
    upload.call.Send(HeaderOf(bytes));
    v1::UploadCaseRequest chunk;
    chunk.mutable_chunk()->set_data(bytes);
    chunk.mutable_chunk()->set_finish_write(true);
    upload.call.Send(chunk);
    EXPECT_TRUE(upload.EndsWith(code));
    if (code == Code::OK) continue;
    EXPECT_THAT(upload.message, HasSubstr("max_cases"));
    ASSERT_THAT(store_.Delete({sha256_}), IsOk());
    ASSERT_THAT(store_.Delete({Sha256Hex({absl::StrCat(other, 0)})}), IsOk());
  }
}

TEST_F(CaseUploadStreamTest, NoMoreThanTheLimitAreReceivedAtATimeAndPlacesAreGivenBack) {
  ServiceLimits none = limits_;
  none.max_case_uploads = 0;
  CaseService full(&gate_, none, &no_logins_.access, &store_, workers_.get(), &timer_);
  CaseCall refused(reactions_.get(), &full);
  refused.call.Send(HeaderOf(bytes_));
  EXPECT_TRUE(refused.EndsWith(Code::RESOURCE_EXHAUSTED));
  EXPECT_THAT(refused.message, HasSubstr("max_case_uploads"));
  ServiceLimits one = limits_;
  one.max_case_uploads = 1;
  CaseService service(&gate_, one, &no_logins_.access, &store_, workers_.get(), &timer_);
  for (const bool whole : {false, true, true}) {
    if (Kept()) {
      ASSERT_THAT(store_.Delete({sha256_}), IsOk());
    }
    CaseCall upload(reactions_.get(), &service);
    upload.call.Send(HeaderOf(bytes_));
    upload.call.Send(Chunk(0, whole ? bytes_.size() : 1, true));
    EXPECT_TRUE(upload.EndsWith(whole ? Code::OK : Code::INVALID_ARGUMENT));
  }
}

TEST_F(CaseUploadStreamTest, DoesNotMixBytesOfConcurrentCalls) {
  std::vector<std::unique_ptr<CaseCall>> uploads;
  for (int i = 0; i < 8; ++i) {
    uploads.push_back(Begin());
    for (size_t offset = 0; offset < bytes_.size(); offset += 700) {
      uploads.back()->call.Send(Chunk(offset, 700, offset + 700 >= bytes_.size()));
    }
  }
  for (const auto& upload : uploads) EXPECT_TRUE(upload->EndsWith(Code::OK));
  EXPECT_EQ(*(*store_.Open({sha256_}, 0))->Read(0, 10'000), bytes_);
}

TEST_F(CaseUploadStreamTest, SilentUploadEnds) {
  ServiceLimits impatient = limits_;
  impatient.upload_silence = std::chrono::milliseconds(20);
  CaseService service(&gate_, impatient, &no_logins_.access, &store_, workers_.get(), &timer_);
  CaseCall silent(reactions_.get(), &service);
  EXPECT_TRUE(silent.EndsWith(Code::DEADLINE_EXCEEDED));
  CaseCall begun(reactions_.get(), &service);
  begun.call.Send(HeaderOf(bytes_));
  begun.call.Send(Chunk(0, 100));
  EXPECT_TRUE(begun.EndsWith(Code::DEADLINE_EXCEEDED));
  EXPECT_FALSE(Kept());
}

class ReadCaseTest : public CaseUploadStreamTest {
 protected:
  // Workers wait until the call is bound: what happens before that meets at a lock inside gRPC,
  // which ThreadSanitizer does not see.
  void Bind(FakeWriterCall<v1::ReadCaseResponse>* call, CaseService* service,
            const v1::ReadCaseRequest* request) {
    std::promise<void> bound;
    const std::shared_future<void> is_bound = bound.get_future().share();
    for (int worker = 0; worker < kStoreWorkers; ++worker) {
      workers_->Post(Lane::kStore, [is_bound] { is_bound.wait(); });
    }
    call->Bind(service->ReadCase(nullptr, request));
    bound.set_value();
  }

  ReadCaseTest() {
    limits_.max_chunk_bytes = 3'000;
    SendAll(Code::OK);
  }

  // What a part gives; its end in `status_`.
  std::string Read(int64_t offset, int64_t limit, const std::string& name = "") {
    CaseService service(&gate_, limits_, &no_logins_.access, &store_, workers_.get(), &timer_);
    v1::ReadCaseRequest request;
    request.set_name(name.empty() ? "cases/" + sha256_ : name);
    request.set_read_offset(offset);
    request.set_read_limit(limit);
    FakeWriterCall<v1::ReadCaseResponse> call(reactions_.get());
    Bind(&call, &service, &request);
    std::string bytes;
    for (;;) {
      const std::optional<v1::ReadCaseResponse> message = call.Receive();
      if (!message.has_value()) break;
      EXPECT_EQ(message->offset(), offset + static_cast<int64_t>(bytes.size()));
      EXPECT_EQ(message->total_bytes(), 10'000);
      EXPECT_LE(message->data().size(), 3'000U);
      bytes += message->data();
    }
    status_ = *call.WaitUntilDone();
    return bytes;
  }

  grpc::Status status_;
};

TEST_F(ReadCaseTest, APartComesInChunksThatFollowEachOther) {
  EXPECT_EQ(Read(0, 0), bytes_);
  EXPECT_TRUE(status_.ok());
  EXPECT_EQ(Read(100, 7'000), bytes_.substr(100, 7'000));
  EXPECT_EQ(Read(9'999, 0), bytes_.substr(9'999));
  EXPECT_EQ(Read(5'000, INT64_MAX), bytes_.substr(5'000));
  EXPECT_EQ(Read(10'000, 0), "");
  EXPECT_TRUE(status_.ok());
}

TEST_F(ReadCaseTest, RefusesInvalidParts) {
  for (const int64_t offset : {int64_t{-1}, int64_t{10'001}, INT64_MIN, INT64_MAX}) {
    EXPECT_EQ(Read(offset, 0), "");
    EXPECT_EQ(status_.error_code(), Code::INVALID_ARGUMENT) << offset;
  }
  Read(0, -1);
  EXPECT_EQ(status_.error_code(), Code::INVALID_ARGUMENT);
  Read(0, 0, "meshes/" + sha256_);
  EXPECT_EQ(status_.error_code(), Code::INVALID_ARGUMENT);
  Read(0, 0, "cases/" + std::string(64, 'a'));
  EXPECT_EQ(status_.error_code(), Code::NOT_FOUND);
}

TEST_F(ReadCaseTest, AClientThatIsGoneEndsIt) {
  v1::ReadCaseRequest request;
  request.set_name("cases/" + sha256_);
  FakeWriterCall<v1::ReadCaseResponse> call(reactions_.get());
  call.StopReading();
  Bind(&call, &service_, &request);
  call.Cancel();
  EXPECT_FALSE(call.WaitUntilDone()->ok());
  EXPECT_TRUE(gate_.WaitUntilIdle(std::chrono::steady_clock::now() + std::chrono::seconds(30)));
}

TEST_F(ReadCaseTest, DrainingServerRefusesUploadsButServesReads) {
  gate_.StartDraining();
  EXPECT_TRUE(Begin()->EndsWith(Code::UNAVAILABLE));
  v1::ReadCaseRequest request;
  request.set_name("cases/" + sha256_);
  FakeWriterCall<v1::ReadCaseResponse> read(reactions_.get());
  Bind(&read, &service_, &request);
  EXPECT_TRUE(read.WaitUntilDone()->ok());
}

}  // namespace
}  // namespace tissueform::testing
