// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "proto/conversion/answer_conversion.h"

#include "proto/conversion/contact_conversion.h"

namespace tissueform {
namespace {

v1::GaveUp ToProto(Termination gave_up) {
  switch (gave_up) {
    case Termination::kConverged:
      break;
    case Termination::kIterations:
      return v1::GAVE_UP_ITERATIONS;
    case Termination::kNoRoom:
      return v1::GAVE_UP_NO_ROOM;
    case Termination::kArithmetic:
      return v1::GAVE_UP_ARITHMETIC;
    case Termination::kBlocked:
      return v1::GAVE_UP_BLOCKED;
  }
  return v1::GAVE_UP_UNSPECIFIED;
}

// Of a reason that this program does not know yet nothing is said: `converged` states the rest.
Termination ToGaveUp(v1::GaveUp gave_up) {
  switch (gave_up) {
    case v1::GAVE_UP_ITERATIONS:
      return Termination::kIterations;
    case v1::GAVE_UP_NO_ROOM:
      return Termination::kNoRoom;
    case v1::GAVE_UP_ARITHMETIC:
      return Termination::kArithmetic;
    case v1::GAVE_UP_BLOCKED:
      return Termination::kBlocked;
    default:
      return Termination::kConverged;
  }
}

}  // namespace

v1::SolveSummary ToProto(const SolveSummary& summary) {
  v1::SolveSummary proto;
  proto.set_solve_seconds(summary.solve_seconds);
  proto.set_iterations(summary.iterations);
  proto.set_converged(summary.converged);
  proto.set_residual(summary.residual);
  proto.mutable_changes_mm()->Add(summary.changes_mm.begin(), summary.changes_mm.end());
  proto.set_cancelled(summary.cancelled);
  proto.mutable_energies_nj()->Add(summary.energies_nj.begin(), summary.energies_nj.end());
  proto.set_load(summary.load);
  proto.set_prepared(summary.prepared);
  proto.set_error_bound_mm(summary.error_bound_mm);
  proto.set_error_estimate_mm(summary.error_estimate_mm);
  proto.set_gave_up(ToProto(summary.gave_up));
  proto.set_obstacle(summary.obstacle);
  proto.set_newton_steps(summary.newton_steps);
  proto.set_second_factor_bytes(summary.second_factor_bytes);
  return proto;
}

v1::SolveSummary ToSummaryProto(const Deformation& deformation, DeformationModel model) {
  v1::SolveSummary proto = ToProto(deformation.summary);
  if (const auto contact = SummarizeContact(deformation.contact, model)) {
    *proto.mutable_contact() = ToProto(*contact);
  }
  if (deformation.seal) *proto.mutable_seal() = ToProto(*deformation.seal);
  return proto;
}

SolveSummary ToSolveSummary(const v1::SolveSummary& proto) {
  SolveSummary summary;
  summary.solve_seconds = proto.solve_seconds();
  summary.iterations = proto.iterations();
  summary.converged = proto.converged();
  summary.residual = proto.residual();
  summary.changes_mm = {proto.changes_mm().begin(), proto.changes_mm().end()};
  summary.cancelled = proto.cancelled();
  summary.energies_nj = {proto.energies_nj().begin(), proto.energies_nj().end()};
  summary.load = proto.load();
  summary.prepared = proto.prepared();
  summary.error_bound_mm = proto.error_bound_mm();
  summary.error_estimate_mm = proto.error_estimate_mm();
  summary.gave_up = ToGaveUp(proto.gave_up());
  summary.obstacle = proto.obstacle();
  summary.newton_steps = proto.newton_steps();
  summary.second_factor_bytes = proto.second_factor_bytes();
  return summary;
}

v1::DeformationQuality ToProto(const DeformationQuality& quality) {
  v1::DeformationQuality proto;
  proto.set_inverted_tet_count(quality.inverted_tets);
  proto.set_min_volume_ratio(quality.min_volume_ratio);
  proto.set_max_volume_ratio(quality.max_volume_ratio);
  proto.set_total_volume_ratio(quality.total_volume_ratio);
  proto.set_worst_tet(quality.worst_tet);
  proto.set_max_displacement_mm(quality.max_displacement_mm);
  return proto;
}

DeformationQuality ToDeformationQuality(const v1::DeformationQuality& proto) {
  DeformationQuality quality;
  quality.inverted_tets = proto.inverted_tet_count();
  quality.min_volume_ratio = proto.min_volume_ratio();
  quality.max_volume_ratio = proto.max_volume_ratio();
  quality.total_volume_ratio = proto.total_volume_ratio();
  quality.worst_tet = proto.worst_tet();
  quality.max_displacement_mm = proto.max_displacement_mm();
  return quality;
}

void SetPreparation(const PreparationSummary& preparation, v1::Session* session) {
  session->set_bytes_held(preparation.bytes_held);
  session->set_factor_bytes(preparation.factor_bytes);
  session->mutable_seconds()->set_assemble(preparation.assemble_seconds);
  session->mutable_seconds()->set_analyse(preparation.analyse_seconds);
  session->mutable_seconds()->set_factorise(preparation.factorise_seconds);
  session->mutable_seconds()->set_prepare(preparation.prepare_seconds);
  session->set_negative_weight_count(preparation.negative_weights);
  session->set_harmonic_min(preparation.harmonic_min);
  session->set_harmonic_max(preparation.harmonic_max);
}

PreparationSummary ToPreparationSummary(const v1::Session& session) {
  PreparationSummary preparation;
  preparation.assemble_seconds = session.seconds().assemble();
  preparation.analyse_seconds = session.seconds().analyse();
  preparation.factorise_seconds = session.seconds().factorise();
  preparation.prepare_seconds = session.seconds().prepare();
  preparation.factor_bytes = session.factor_bytes();
  preparation.bytes_held = session.bytes_held();
  preparation.negative_weights = session.negative_weight_count();
  preparation.harmonic_min = session.harmonic_min();
  preparation.harmonic_max = session.harmonic_max();
  return preparation;
}

}  // namespace tissueform
