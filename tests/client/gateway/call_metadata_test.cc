// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/call_metadata.h"

#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using std::chrono::nanoseconds;
using testing::IsOk;

TEST(CallMetadata, OnlyOurMethodsAndHealthAreServed) {
  for (const char* method : {"/tissueform.v1.MeshService/GetMesh", "/grpc.health.v1.Health/Check",
                             "/tissueform.v1.NewService/NewMethod"}) {
    EXPECT_TRUE(IsServedMethod(method)) << method;
  }
  for (const char* method :
       {"", "/", "/tissueform.v1.", "/tissueform.v1./Get", "/tissueform.v1.MeshService/",
        "/tissueform.v1.MeshService", "/tissueform.v1.MeshService/Get/Mesh",
        "/tissueform.v1.MeshService/Get\nMesh", "/tissueform.v1.Mesh Service/GetMesh",
        "/tissueform.v1.a..b/GetMesh", "/grpc.health.v1.Health/Watch",
        "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo",
        "tissueform.v1.MeshService/GetMesh", "/tissueform.v2.MeshService/GetMesh"}) {
    EXPECT_FALSE(IsServedMethod(method)) << method;
  }
  EXPECT_FALSE(IsServedMethod("/tissueform.v1.S/" + std::string(300, 'a')));
}

TEST(CallMetadata, OmitsOtherBrowserHeaders) {
  const HttpHead head = {.method = "POST",
                         .target = "/x",
                         .fields = {{"cookie", "secret"},
                                    {"authorization", "Bearer t"},
                                    {"user-agent", "x"},
                                    {"x-tissueform-session", "sessions/1"},
                                    {"x-tissueform-other", "x"},
                                    {"grpc-timeout", "1S"},
                                    {"traceparent", "00-1"}}};
  const std::map<std::string, std::string> expected = {{"authorization", "Bearer t"},
                                                       {"traceparent", "00-1"},
                                                       {"x-tissueform-session", "sessions/1"}};
  EXPECT_EQ(MetadataOf(head), expected);
}

TEST(CallMetadata, RefusesValuesThatWouldAbortTheProcess) {
  EXPECT_THAT(CheckMetadata({{"authorization", "Bearer ~ !"}}), IsOk());
  for (const std::string& value :
       {std::string("a\nb"), std::string("\xc3\xa9"), std::string("a\0b", 3), std::string("\x7f"),
        std::string(5000, 'a')}) {
    EXPECT_EQ(CheckMetadata({{"authorization", value}}).code(), absl::StatusCode::kInvalidArgument);
  }
}

TEST(CallMetadata, TimeoutsHaveUnits) {
  EXPECT_EQ(*ParseGrpcTimeout("2H"), std::chrono::hours(2));
  EXPECT_EQ(*ParseGrpcTimeout("3M"), std::chrono::minutes(3));
  EXPECT_EQ(*ParseGrpcTimeout("4S"), std::chrono::seconds(4));
  EXPECT_EQ(*ParseGrpcTimeout("250m"), std::chrono::milliseconds(250));
  EXPECT_EQ(*ParseGrpcTimeout("6u"), std::chrono::microseconds(6));
  EXPECT_EQ(*ParseGrpcTimeout("0n"), nanoseconds(0));
}

TEST(CallMetadata, TheLongestTimeoutIsAYear) {
  EXPECT_EQ(*ParseGrpcTimeout("99999999H"), std::chrono::hours(365 * 24));
}

TEST(CallMetadata, RefusesInvalidTimeouts) {
  for (const char* text : {"", "S", "1", "-1S", "+1S", "1.5S", "123456789S", "1s", " 1S", "1S "}) {
    EXPECT_EQ(ParseGrpcTimeout(text).status().code(), absl::StatusCode::kInvalidArgument) << text;
  }
}

}  // namespace
}  // namespace tissueform
