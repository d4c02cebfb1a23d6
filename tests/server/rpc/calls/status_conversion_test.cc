// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/calls/status_conversion.h"

#include <cerrno>
#include <string>

#include "gmock/gmock.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "gtest/gtest.h"

#include "client/cpp/client_call.h"
#include "core/base/error_reason.h"
#include "server/platform/storage/durable_file.h"

namespace tissueform {
namespace {

TEST(StatusConversionTest, OkIsOk) { EXPECT_TRUE(ToGrpcStatus(absl::OkStatus()).ok()); }

TEST(StatusConversionTest, CodeAndMessageAreKept) {
  const grpc::Status status = ToGrpcStatus(absl::ResourceExhaustedError("no room"));
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(status.error_message(), "no room");
  EXPECT_EQ(ToGrpcStatus(absl::DataLossError("")).error_code(), grpc::StatusCode::DATA_LOSS);
  EXPECT_EQ(ToGrpcStatus(absl::UnauthenticatedError("")).error_code(),
            grpc::StatusCode::UNAUTHENTICATED);
}

TEST(StatusConversionTest, LongMessagesAreCut) {
  const grpc::Status status = ToGrpcStatus(absl::InvalidArgumentError(std::string(100'000, 'x')));
  EXPECT_EQ(status.error_message(), std::string(1024, 'x'));
}

google::rpc::Status DetailsOf(const grpc::Status& status) {
  google::rpc::Status details;
  EXPECT_TRUE(details.ParseFromString(status.error_details()));
  return details;
}

TEST(StatusConversionTest, ErrorsCarryTheirReasonAsGoogleRpcSaysIt) {
  const google::rpc::Status details = DetailsOf(ToGrpcStatus(WithReason(
      absl::ResourceExhaustedError("full"), ErrorReason::kTooManyStreams, {{"limit", "64"}})));
  EXPECT_EQ(details.code(), 8);
  EXPECT_EQ(details.message(), "full");
  ASSERT_EQ(details.details_size(), 1);
  google::rpc::ErrorInfo info;
  ASSERT_TRUE(details.details(0).UnpackTo(&info));
  EXPECT_EQ(info.domain(), "tissueform");
  EXPECT_EQ(info.reason(), "TOO_MANY_STREAMS");
  EXPECT_EQ(info.metadata().at("limit"), "64");
}

TEST(StatusConversionTest, ReportsTheRetryDelayAsGooglesRetryInfo) {
  const google::rpc::Status details = DetailsOf(
      ToGrpcStatus(WithReason(absl::ResourceExhaustedError("too often"),
                              ErrorReason::kQuotaExceeded, {{"retry_after_ms", "1500"}})));
  ASSERT_EQ(details.details_size(), 2);
  google::rpc::RetryInfo retry;
  ASSERT_TRUE(details.details(1).UnpackTo(&retry));
  EXPECT_EQ(retry.retry_delay().seconds(), 1);
  EXPECT_EQ(retry.retry_delay().nanos(), 500'000'000);
}

TEST(StatusConversionTest, StatusRoundTrips) {
  const absl::Status status =
      WithReason(absl::NotFoundError("no such mesh"), ErrorReason::kMeshNotFound, {{"a", "b=c"}});
  EXPECT_EQ(FromGrpcStatus(ToGrpcStatus(status)), status);  // payloads too
}

TEST(StatusConversionTest, OmitsPathsOfTheServer) {
  const absl::Status status = FileError(ENOSPC, "cannot write", "/srv/patients/tissueform.db-wal");
  EXPECT_THAT(std::string(status.message()), ::testing::HasSubstr("/srv/patients"));
  const grpc::Status sent = ToGrpcStatus(status);
  EXPECT_EQ(sent.error_message(),
            "cannot write (on the server): the disk is full; free some space");
  EXPECT_THAT(sent.error_details(), ::testing::Not(::testing::HasSubstr("patients")));
}

TEST(StatusConversionTest, UnknownDetailsKeepTheCodeAndTheMessage) {
  for (const char* details : {"", "\xff\xff", "\x1a\x02\x12\x00"}) {
    const absl::Status status =
        FromGrpcStatus({grpc::StatusCode::NOT_FOUND, "no such mesh", details});
    EXPECT_EQ(status, absl::NotFoundError("no such mesh"));
  }
}

TEST(StatusConversionTest, ALongMessageIsNotCutThroughALetter) {
  std::string message(1023, 'x');
  message += "\u00e4\u00e4";
  const google::rpc::Status details = DetailsOf(ToGrpcStatus(absl::InternalError(message)));
  EXPECT_EQ(details.message(), std::string(1023, 'x'));
}

}  // namespace
}  // namespace tissueform
