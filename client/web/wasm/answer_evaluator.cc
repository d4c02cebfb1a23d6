// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/answer_evaluator/answer_evaluator.h"

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/mechanics/answer_evaluator/answer_bytes.h"

// The evaluator for browsers, of one list of prepared answers per instance of the module:
// deploy/build_web.sh compiles it, and client/web/src/evaluation/answer_evaluator.ts calls it.
// Arrays stay where they are until the next call that writes them.
namespace tissueform {
namespace {

struct Instance {
  std::string bytes;
  std::string message;
  std::optional<AnswerEvaluator> evaluator;
  std::vector<AnswerPose> poses;
  std::vector<float> positions;
  std::vector<int32_t> places;
  std::vector<ChosenVertex> chosen;
  std::vector<float> chosen_positions;
  std::vector<float> band_mm;
  TouchForces touch;
  double error_mm = 0;
};

Instance& Self() {
  static Instance instance;
  return instance;
}

}  // namespace
}  // namespace tissueform

#define EXPORT(name) extern "C" __attribute__((export_name(#name)))

// Where that many bytes of prepared answers are to be written before `open`.
EXPORT(reserve) char* Reserve(size_t size) {
  auto& self = tissueform::Self();
  self.bytes.resize(size);
  return self.bytes.data();
}

// Reads the bytes, which are then given up. Returns whether they may be evaluated; otherwise
// `message` says why not.
EXPORT(open) bool Open() {
  auto& self = tissueform::Self();
  tissueform::AnswerReading reading = tissueform::ReadAnswers(self.bytes);
  self.bytes = {};
  self.message = std::move(reading.message);
  if (reading.error != tissueform::AnswerError::kNone) return false;
  self.poses.resize(static_cast<size_t>(reading.answers.numbers.num_handles));
  self.evaluator.emplace(std::move(reading.answers));
  return true;
}

// Ends with a zero.
EXPORT(message) const char* Message() { return tissueform::Self().message.c_str(); }

EXPORT(num_handles) size_t NumHandles() { return tissueform::Self().poses.size(); }
EXPORT(num_vertices) size_t NumVertices() {
  return tissueform::Self().evaluator->answers().regions.size();
}
EXPORT(is_estimate) bool IsEstimate() {
  return tissueform::IsModel(tissueform::Self().evaluator->answers(),
                             tissueform::AnswerModel::kNeoHookean);
}
EXPORT(has_band) bool HasBand() { return tissueform::Self().evaluator->has_band(); }

// Of each handle ten numbers: rotation vector, pivot, translation, scale.
EXPORT(poses) double* Poses() {
  static_assert(sizeof(tissueform::AnswerPose) == 10 * sizeof(double));
  return tissueform::Self().poses.data()->rotation_vector.data();
}

// Whether the poses are covered; then `positions` are written. Writes `error_mm` always.
EXPORT(evaluate) bool Evaluate() {
  auto& self = tissueform::Self();
  return self.evaluator->Answer(self.poses, &self.positions, &self.error_mm);
}
EXPORT(error_mm) double ErrorMm() { return tissueform::Self().error_mm; }
// Where the numbers of `count` vertices are to be written before `choose`.
EXPORT(places) int32_t* Places(size_t count) {
  auto& self = tissueform::Self();
  self.places.resize(count);
  return self.places.data();
}
EXPORT(choose) float* Choose() {
  auto& self = tissueform::Self();
  self.chosen = self.evaluator->Choose(self.places);
  self.chosen_positions.resize(3 * self.chosen.size());
  return self.chosen_positions.data();
}
// Whether the poses are covered; then the positions of the chosen vertices are written where
// `choose` said.
EXPORT(evaluate_chosen) bool EvaluateChosen() {
  auto& self = tissueform::Self();
  return tissueform::AnswerAt(*self.evaluator, self.poses, self.chosen,
                              self.chosen_positions.data());
}

EXPORT(positions) const float* Positions() { return tissueform::Self().positions.data(); }

// The number of contact rows that may lift off: of each the force in Pa mm^2 is written.
EXPORT(evaluate_contact) size_t EvaluateContact() {
  auto& self = tissueform::Self();
  self.touch = self.evaluator->TouchForcesAt(self.poses);
  return self.touch.contact.size();
}
EXPORT(contact_forces) const double* ContactForces() {
  return tissueform::Self().touch.contact.data();
}
// Of the lips at the last `evaluate_contact`: pairs of the seal, 0 where lips are free; how far the
// edges are parted in height before they are sealed; and whether that is too far for a seal.
EXPORT(seal_pairs) size_t SealPairs() { return tissueform::Self().touch.seal.size(); }
EXPORT(seal_parted_mm) double SealPartedMm() {
  return tissueform::Self().touch.seal_state.value_or(tissueform::SealState()).parted_mm;
}
EXPORT(seal_released) bool SealReleased() {
  return tissueform::Self().touch.seal_state.value_or(tissueform::SealState()).released;
}

// Whether the poses have a band; then it is written.
EXPORT(evaluate_band) bool EvaluateBand() {
  auto& self = tissueform::Self();
  return self.evaluator->Band(self.poses, &self.band_mm);
}
EXPORT(band_mm) const float* BandMm() { return tissueform::Self().band_mm.data(); }
