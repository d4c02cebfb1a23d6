// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/client_call.h"

#include <string>

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "gtest/gtest.h"

#include "core/base/error_reason.h"

namespace tissueform {
namespace {

std::string DetailsWith(int code, ErrorReason reason) {
  google::rpc::ErrorInfo info;
  info.set_reason(std::string(ReasonName(reason)));
  google::rpc::Status details;
  details.set_code(code);
  details.set_message("said by the server");
  details.add_details()->PackFrom(info);
  return details.SerializeAsString();
}

constexpr auto kCut = grpc::StatusCode::CANCELLED;

TEST(EndOfCallTest, ServersCodeAndMessageTakePrecedence) {
  const absl::Status end =
      EndOfCall({kCut, "RST_STREAM", DetailsWith(5, ErrorReason::kSessionNotFound)});
  EXPECT_EQ(end.code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(end.message(), "said by the server");
  EXPECT_TRUE(HasReason(end, ErrorReason::kSessionNotFound));
}

TEST(EndOfCallTest, IgnoresAnInvalidCodeInTheDetails) {
  for (const int code : {0, -1, 17, 1'000'000}) {
    const absl::Status end = EndOfCall(
        {grpc::StatusCode::INTERNAL, "broken", DetailsWith(code, ErrorReason::kInternalError)});
    EXPECT_EQ(end.code(), absl::StatusCode::kInternal) << code;
    EXPECT_EQ(end.message(), "broken");
  }
}

TEST(EndOfCallTest, OkStaysOkWhateverTheDetailsSay) {
  const grpc::Status odd(grpc::StatusCode::OK, "", DetailsWith(5, ErrorReason::kMeshNotFound));
  EXPECT_TRUE(EndOfCall(odd).ok());
}

TEST(EndOfCallTest, RemoteCancellationIsUnavailable) {
  const absl::Status end = EndOfCall({kCut, "RST_STREAM"});
  EXPECT_EQ(end, absl::UnavailableError("RST_STREAM"));
  EXPECT_TRUE(HasReason(end, ErrorReason::kUnavailable));
  EXPECT_EQ(EndOfCall({kCut, "gone", DetailsWith(kCut, ErrorReason::kCancelled)}),
            absl::UnavailableError("gone"));
}

TEST(EndOfCallTest, AReasonThatDoesNotFitTheCodeStays) {
  const absl::Status end =
      EndOfCall({kCut, "RST_STREAM", DetailsWith(0, ErrorReason::kSessionMoved)});
  EXPECT_TRUE(absl::IsUnavailable(end));
  EXPECT_TRUE(HasReason(end, ErrorReason::kSessionMoved));
}

TEST(EndOfCallTest, LocalCancellationIsReportedAsCancelled) {
  EXPECT_TRUE(absl::IsCancelled(EndOfCall({kCut, "cancelled"}, /*was_cancelled=*/true)));
  EXPECT_TRUE(absl::IsUnavailable(
      EndOfCall({grpc::StatusCode::UNAVAILABLE, "gone"}, /*was_cancelled=*/true)));
}

}  // namespace
}  // namespace tissueform
