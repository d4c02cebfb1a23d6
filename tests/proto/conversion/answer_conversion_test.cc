// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "proto/conversion/answer_conversion.h"

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace tissueform {
namespace {

using ::testing::ElementsAre;

TEST(AnswerConversionTest, ASummarySurvivesTheJourney) {
  SolveSummary summary;
  summary.iterations = 3;
  summary.converged = false;
  summary.cancelled = true;
  summary.residual = 1e-9;
  summary.solve_seconds = 0.5;
  summary.changes_mm = {2, 1};
  summary.energies_nj = {9, 8, 7};
  summary.load = 0.75;
  summary.prepared = true;
  summary.error_bound_mm = 0.01;
  summary.error_estimate_mm = 0.02;
  summary.obstacle = "chin would have to pass through jaw";
  summary.newton_steps = 2;
  summary.second_factor_bytes = 5;
  const SolveSummary back = ToSolveSummary(ToProto(summary));
  EXPECT_EQ(back.iterations, 3);
  EXPECT_FALSE(back.converged);
  EXPECT_TRUE(back.cancelled);
  EXPECT_EQ(back.residual, 1e-9);
  EXPECT_EQ(back.solve_seconds, 0.5);
  EXPECT_THAT(back.changes_mm, ElementsAre(2, 1));
  EXPECT_THAT(back.energies_nj, ElementsAre(9, 8, 7));
  EXPECT_EQ(back.load, 0.75);
  EXPECT_TRUE(back.prepared);
  EXPECT_EQ(back.error_bound_mm, 0.01);
  EXPECT_EQ(back.error_estimate_mm, 0.02);
  EXPECT_EQ(back.obstacle, "chin would have to pass through jaw");
  EXPECT_EQ(back.newton_steps, 2);
  EXPECT_EQ(back.second_factor_bytes, 5);
}

TEST(AnswerConversionTest, EveryReasonToGiveUpSurvivesTheJourney) {
  for (const Termination reason :
       {Termination::kConverged, Termination::kIterations, Termination::kNoRoom,
        Termination::kArithmetic, Termination::kBlocked}) {
    SolveSummary summary;
    summary.gave_up = reason;
    EXPECT_EQ(ToSolveSummary(ToProto(summary)).gave_up, reason) << TerminationName(reason);
  }
}

TEST(AnswerConversionTest, IgnoresAnUnknownReasonOfALaterServer) {
  v1::SolveSummary proto;
  proto.set_gave_up(static_cast<v1::GaveUp>(99));
  EXPECT_EQ(ToSolveSummary(proto).gave_up, Termination::kConverged);
}

TEST(AnswerConversionTest, QualitySurvivesTheJourney) {
  const DeformationQuality back =
      ToDeformationQuality(ToProto(DeformationQuality{.inverted_tets = 1,
                                                      .min_volume_ratio = -0.5,
                                                      .worst_tet = 7,
                                                      .max_volume_ratio = 2,
                                                      .total_volume_ratio = 1.1,
                                                      .max_displacement_mm = 12}));
  EXPECT_EQ(back.inverted_tets, 1);
  EXPECT_EQ(back.min_volume_ratio, -0.5);
  EXPECT_EQ(back.worst_tet, 7);
  EXPECT_EQ(back.max_volume_ratio, 2);
  EXPECT_EQ(back.total_volume_ratio, 1.1);
  EXPECT_EQ(back.max_displacement_mm, 12);
}

TEST(AnswerConversionTest, APreparationSurvivesTheJourney) {
  v1::Session session;
  SetPreparation({.assemble_seconds = 1,
                  .analyse_seconds = 2,
                  .factorise_seconds = 3,
                  .prepare_seconds = 4,
                  .factor_bytes = 5,
                  .bytes_held = 6,
                  .own_bytes = 0,
                  .negative_weights = 7,
                  .harmonic_min = -0.25,
                  .harmonic_max = 1.25},
                 &session);
  const PreparationSummary back = ToPreparationSummary(session);
  EXPECT_EQ(back.assemble_seconds, 1);
  EXPECT_EQ(back.analyse_seconds, 2);
  EXPECT_EQ(back.factorise_seconds, 3);
  EXPECT_EQ(back.prepare_seconds, 4);
  EXPECT_EQ(back.factor_bytes, 5);
  EXPECT_EQ(back.bytes_held, 6);
  EXPECT_EQ(back.negative_weights, 7);
  EXPECT_EQ(back.harmonic_min, -0.25);
  EXPECT_EQ(back.harmonic_max, 1.25);
}

}  // namespace
}  // namespace tissueform
