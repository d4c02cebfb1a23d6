// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "proto/conversion/contact_conversion.h"

#include <algorithm>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "proto/conversion/answer_conversion.h"
#include "proto/conversion/session_conversion.h"
#include "tests/testing/handle_problem.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::RandomNumbers;
using ::tissueform::testing::StatusIs;

const std::vector<HandleRegion> kHandles = {{"chin", {1}}, {"maxilla", {2, 3}}};

std::vector<ContactRow> RandomRows(RandomNumbers* random) {
  std::vector<ContactRow> rows(20);
  for (size_t i = 0; i < rows.size(); ++i) {
    rows[i].vertex = static_cast<int32_t>(100 + i);
    rows[i].normal = random->Vector().normalized();
    if (i % 4 == 0) rows[i].other = static_cast<int32_t>(i);  // also vertex 0
    if (i % 4 == 1) rows[i].handle = 1;
    if (i % 4 == 2) rows[i].bilateral = true;
    if (i % 4 != 2) rows[i].gap_mm = std::max(0.0, random->Next());
  }
  return rows;
}

TEST(ContactConversionTest, RowsSurviveTheJourneyAlsoInARequest) {
  RandomNumbers random(11);
  for (int run = 0; run < 50; ++run) {
    SessionRequest request;
    request.handles = kHandles;
    request.contact = RandomRows(&random);
    const v1::CreateSessionRequest proto = ToProto(request);
    ASSERT_OK_AND_ASSIGN(const auto rows, ToContactRows(proto.contact(), kHandles));
    EXPECT_EQ(rows, request.contact);
    ASSERT_OK_AND_ASSIGN(const SessionRequest back, ToSessionRequest(proto, {.num_vertices = 200}));
    EXPECT_EQ(back.contact, request.contact);
  }
}

TEST(ContactConversionTest, WithoutRowsARequestIsAsBefore) {
  RandomNumbers random(12);
  SessionRequest request;
  request.handles = kHandles;
  const std::string before = ToProto(request).SerializeAsString();
  const std::string fingerprint = RequestFingerprint(ToProto(request));
  request.contact = RandomRows(&random);
  EXPECT_NE(RequestFingerprint(ToProto(request)), fingerprint);
  v1::CreateSessionRequest cleared = ToProto(request);
  cleared.clear_contact();
  EXPECT_EQ(cleared.SerializeAsString(), before);
}

TEST(ContactConversionTest, NamesARowWithoutAContactPartner) {
  const auto refused = [](auto change, const std::string& why) {
    ContactRowProtos rows = ToProto({{.vertex = 4}, {.vertex = 5, .handle = 0}}, kHandles);
    change(rows[1]);
    EXPECT_THAT(ToContactRows(rows, kHandles),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(why)));
  };
  refused([](auto& row) { row.clear_other(); }, "contact row 1 touches nothing");
  refused([](auto& row) { row.set_handle("other"); }, "contact row 1 names a handle");
  refused([](auto& row) { row.set_fixed_bone(false); }, "contact row 1 has fixed_bone false");
  refused([](auto& row) { row.set_other_vertex(-1); }, "contact row 1 names vertex -1");
  ContactRowProtos many;
  while (many.size() <= static_cast<int>(kMaxContactRows)) many.Add()->set_fixed_bone(true);
  EXPECT_THAT(ToContactRows(many, {}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("16384 at most")));
}

TEST(ContactConversionTest, ASummaryIsThereWhereRowsMayLiftOff) {
  Deformation deformation;
  EXPECT_FALSE(ToSummaryProto(deformation, DeformationModel::kLinearElastic).has_contact());
  deformation.contact = {.forces = {0, 2e6, 1e6}, .gaps_mm = {0.5, 0, 0}, .residual_mm = 1e-12};
  ContactSummary expected{.rows = 3, .pressing_rows = 2, .max_force_n = 2, .residual_mm = 1e-12};
  EXPECT_EQ(
      ToContactSummary(ToSummaryProto(deformation, DeformationModel::kLinearElastic).contact()),
      expected);
  expected.max_force_n.reset();  // not known to models without forces
  EXPECT_EQ(ToContactSummary(ToSummaryProto(deformation, DeformationModel::kArap).contact()),
            expected);
}

}  // namespace
}  // namespace tissueform
