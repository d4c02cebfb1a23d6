// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/session_record.h"

#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using ::tissueform::testing::StatusIs;

SessionRecord SomeRecord() {
  SessionRecord record;
  record.id = "0123456789abcdef";
  record.owner = "planner";
  record.project = "study";
  record.mesh_sha256 = std::string(64, 'a');
  record.stiffness = "youngs_modulus_pa";
  record.fixed = {5, 0, 9};
  record.handles = {{"chin", {1}}, {"maxilla", {2, 3}}};
  record.model = DeformationModel::kNeoHookean;
  record.poisson_ratio = 0.3;
  record.gradient_field.rotation = RotationMode::kEstimated;
  record.gradient_field.guidance = Guidance::kUniform;
  record.gradient_field.blend = BlendMap::kLinear;
  record.gradient_field.max_iterations = 99;
  record.gradient_field.tolerance_mm = 1e-5;
  record.last_poses.resize(2);
  record.last_poses[1] = {.rotation_vector = {0.1, 0.2, 0.3},
                          .pivot_mm = {1, 2, 3},
                          .translation_mm = {4, 5, 6},
                          .scale = 1.5};
  record.node_order = {2, 0, 1};
  record.request_id = "once";
  record.request_fingerprint = "print";
  return record;
}

TEST(SessionRecordTest, ARecordSurvivesItsBytes) {
  const SessionRecord record = SomeRecord();
  ASSERT_OK_AND_ASSIGN(const SessionRecord back, ParseRecord(SerializeRecord(record)));
  EXPECT_EQ(back.id, record.id);
  EXPECT_EQ(back.owner, record.owner);
  EXPECT_EQ(back.project, record.project);
  EXPECT_EQ(back.mesh_sha256, record.mesh_sha256);
  EXPECT_EQ(back.stiffness, record.stiffness);
  EXPECT_EQ(back.fixed, record.fixed);
  ASSERT_EQ(back.handles.size(), 2);
  EXPECT_EQ(back.handles[1].name, "maxilla");
  EXPECT_EQ(back.handles[1].vertices, record.handles[1].vertices);
  EXPECT_EQ(back.model, record.model);
  EXPECT_EQ(back.poisson_ratio, record.poisson_ratio);
  EXPECT_EQ(back.gradient_field.rotation, record.gradient_field.rotation);
  EXPECT_EQ(back.gradient_field.guidance, record.gradient_field.guidance);
  EXPECT_EQ(back.gradient_field.blend, record.gradient_field.blend);
  EXPECT_EQ(back.gradient_field.max_iterations, record.gradient_field.max_iterations);
  EXPECT_EQ(back.gradient_field.tolerance_mm, record.gradient_field.tolerance_mm);
  ASSERT_EQ(back.last_poses.size(), 2);
  EXPECT_EQ(back.last_poses[0].translation_mm, Eigen::Vector3d::Zero());
  EXPECT_EQ(back.last_poses[1].rotation_vector, record.last_poses[1].rotation_vector);
  EXPECT_EQ(back.last_poses[1].pivot_mm, record.last_poses[1].pivot_mm);
  EXPECT_EQ(back.last_poses[1].translation_mm, record.last_poses[1].translation_mm);
  EXPECT_EQ(back.last_poses[1].scale, 1.5);
  EXPECT_EQ(back.node_order, record.node_order);
  EXPECT_EQ(back.request_id, record.request_id);
  EXPECT_EQ(back.request_fingerprint, record.request_fingerprint);
  EXPECT_EQ(SerializeRecord(back), SerializeRecord(record)) << "nothing else is in the bytes";
}

TEST(SessionRecordTest, ContactRowsComeAfterAllThatRecordsWithoutThemHold) {
  SessionRecord record = SomeRecord();
  const std::string without = SerializeRecord(record);
  EXPECT_TRUE(ParseRecord(without)->contact.empty());
  record.contact = {{.vertex = 7, .handle = 1, .normal = {0.6, 0, 0.8}, .gap_mm = 0.25},
                    {.vertex = 8, .bilateral = true},
                    {.vertex = 10, .other = 0}};
  const std::string with = SerializeRecord(record);
  EXPECT_TRUE(with.starts_with(without)) << "older records are as before";
  ASSERT_OK_AND_ASSIGN(const SessionRecord back, ParseRecord(with));
  EXPECT_EQ(back.contact, record.contact);
  EXPECT_EQ(SerializeRecord(back), with);
}

TEST(SessionRecordTest, AUniformStiffnessAndAPoissonRatioOfZeroSurvive) {
  SessionRecord record = SomeRecord();
  record.stiffness = 0.0;
  record.poisson_ratio = 0;
  ASSERT_OK_AND_ASSIGN(const SessionRecord back, ParseRecord(SerializeRecord(record)));
  EXPECT_EQ(back.stiffness, record.stiffness);
  EXPECT_EQ(back.poisson_ratio, 0);
}

TEST(SessionRecordTest, DamagedBytesAreDataLossAndNeverACrash) {
  const std::string bytes = SerializeRecord(SomeRecord());
  for (size_t length = 0; length < bytes.size(); ++length) {
    // Cut between two fields it may still be a record.
    const auto cut = ParseRecord(bytes.substr(0, length));
    EXPECT_TRUE(cut.ok() || cut.status().code() == absl::StatusCode::kDataLoss) << length;
  }
  for (size_t i = 0; i < bytes.size(); ++i) {
    std::string flipped = bytes;
    flipped[i] = static_cast<char>(flipped[i] ^ 0x41);
    const auto result = ParseRecord(flipped);
    EXPECT_TRUE(result.ok() || result.status().code() == absl::StatusCode::kDataLoss) << i;
  }
}

TEST(SessionRecordTest, InconsistentRecordIsDataLoss) {
  const auto damaged = [](auto change, const char* text) {
    SessionRecord record = SomeRecord();
    change(record);
    EXPECT_THAT(ParseRecord(SerializeRecord(record)),
                StatusIs(absl::StatusCode::kDataLoss, HasSubstr(text)));
  };
  damaged([](SessionRecord& record) { record.id.clear(); }, "id");
  damaged([](SessionRecord& record) { record.mesh_sha256 = "A"; }, "mesh");
  damaged([](SessionRecord& record) { record.last_poses.pop_back(); }, "1 poses for 2 handles");
  damaged([](SessionRecord& record) { record.last_poses[1].scale = -1; }, "pose 1");
  damaged([](SessionRecord& record) { record.node_order[0] = 1; }, "not a permutation");
  damaged([](SessionRecord& record) { record.node_order[0] = 3; }, "not a permutation");
  damaged([](SessionRecord& record) { record.node_order[0] = -1; }, "not a permutation");
}

TEST(SessionRecordTest, PosesAloneSurviveTheirBytes) {
  const std::vector<HandlePose> poses = SomeRecord().last_poses;
  ASSERT_OK_AND_ASSIGN(const std::vector<HandlePose> back, ParsePoses(SerializePoses(poses)));
  ASSERT_EQ(back.size(), 2);
  EXPECT_EQ(back[1].rotation_vector, poses[1].rotation_vector);
  EXPECT_EQ(back[1].pivot_mm, poses[1].pivot_mm);
  EXPECT_EQ(back[1].translation_mm, poses[1].translation_mm);
  EXPECT_EQ(back[1].scale, 1.5);
  ASSERT_OK_AND_ASSIGN(const std::vector<HandlePose> none, ParsePoses(SerializePoses({})));
  EXPECT_TRUE(none.empty());
  std::vector<HandlePose> bad = poses;
  bad[0].scale = 0;
  EXPECT_THAT(ParsePoses(SerializePoses(bad)), StatusIs(absl::StatusCode::kDataLoss));
  EXPECT_THAT(ParsePoses("no poses"), StatusIs(absl::StatusCode::kDataLoss));
}

}  // namespace
}  // namespace tissueform
