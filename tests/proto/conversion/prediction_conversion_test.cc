// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "proto/conversion/prediction_conversion.h"

#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

TEST(PredictionConversionTest, NamesRoundTripAndOthersAreRefused) {
  ASSERT_OK_AND_ASSIGN(const std::string id, ParsePredictionName(PredictionName("ab-12")));
  EXPECT_EQ(id, "ab-12");
  for (const std::string& name :
       {std::string(), std::string("ab-12"), std::string("predictions/"),
        std::string("predictions/../a"), "predictions/" + std::string(65, 'a')}) {
    EXPECT_THAT(ParsePredictionName(name), StatusIs(absl::StatusCode::kInvalidArgument)) << name;
  }
}

TEST(PredictionConversionTest, StatisticsRoundTrip) {
  const DistanceSummary summary = {
      .count = 7, .mean_mm = 1.5, .p50_mm = 1, .p90_mm = 2, .p95_mm = 3, .max_mm = 4};
  const DistanceSummary back = ToDistanceSummary(ToProto(summary));
  EXPECT_EQ(back.count, summary.count);
  EXPECT_EQ(back.mean_mm, summary.mean_mm);
  EXPECT_EQ(back.p50_mm, summary.p50_mm);
  EXPECT_EQ(back.p90_mm, summary.p90_mm);
  EXPECT_EQ(back.p95_mm, summary.p95_mm);
  EXPECT_EQ(back.max_mm, summary.max_mm);
}

TEST(PredictionConversionTest, EqualRequestsHaveEqualFingerprintsWhateverTheirIds) {
  v1::CreatePredictionRequest request;
  request.set_session("sessions/a");
  const std::string fingerprint = RequestFingerprint(request);
  request.set_request_id("1");
  EXPECT_EQ(RequestFingerprint(request), fingerprint);
  request.add_poses()->set_handle("chin");
  EXPECT_NE(RequestFingerprint(request), fingerprint);
}

TEST(PredictionConversionTest, ChunksFollowEachOtherToTheEnd) {
  std::string bytes((size_t{2} << 20) + 5, 'a');
  bytes.back() = 'z';
  std::string joined;
  size_t offset = 0;
  v1::PositionChunk chunk;
  while (NextChunk(bytes, &offset, &chunk)) {
    EXPECT_EQ(chunk.offset(), static_cast<int64_t>(joined.size()));
    EXPECT_EQ(chunk.total_bytes(), static_cast<int64_t>(bytes.size()));
    EXPECT_LE(chunk.data().size(), size_t{1} << 20);
    joined += chunk.data();
  }
  EXPECT_TRUE(joined == bytes);
  offset = 0;
  EXPECT_FALSE(NextChunk("", &offset, &chunk));
}

}  // namespace
}  // namespace tissueform::testing
