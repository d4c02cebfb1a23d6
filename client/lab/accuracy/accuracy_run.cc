// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/accuracy/accuracy_run.h"

#include <algorithm>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

const ModelAnswer* Find(const std::vector<ModelAnswer>& answers, const std::string& name) {
  const auto found = std::find_if(answers.begin(), answers.end(),
                                  [&](const ModelAnswer& answer) { return answer.name == name; });
  return found == answers.end() ? nullptr : &*found;
}

// Models that do not know Poisson's ratio are asked once.
absl::StatusOr<std::vector<ModelAnswer>> AnswerByAllModels(
    const AccuracyCase& problem, double poisson_ratio,
    std::map<std::string, ModelAnswer>* same_for_all) {
  std::vector<ModelAnswer> answers;
  for (const ModelVariant& variant : AllModelVariants()) {
    const auto known = same_for_all->find(variant.name);
    if (known != same_for_all->end()) {
      answers.push_back(known->second);
      continue;
    }
    TF_ASSIGN_OR_RETURN(ModelAnswer answer, AnswerByModel(variant, problem, poisson_ratio));
    if (!variant.uses_poisson_ratio) same_for_all->emplace(variant.name, answer);
    answers.push_back(std::move(answer));
  }
  return answers;
}

absl::StatusOr<std::vector<ModelAnswer>> AnswerByReferences(
    const AccuracyCase& problem, double poisson_ratio, const std::string& folder,
    const std::function<void(const std::string&)>& on_step) {
  std::vector<ModelAnswer> answers;
  for (const CalculixLaw law : {CalculixLaw::kLinear, CalculixLaw::kNeoHookean}) {
    absl::StatusOr<ModelAnswer> answer = AnswerByCalculix(law, problem, poisson_ratio, folder);
    if (absl::IsInternal(answer.status())) {
      on_step(
          absl::StrCat(problem.name, ", nu = ", poisson_ratio, ": ", answer.status().message()));
      continue;
    }
    TF_RETURN_IF_ERROR(answer.status());
    answers.push_back(*std::move(answer));
  }
  return answers;
}

}  // namespace

const ModelAnswer* AccuracyResult::Reference(const std::string& name) const {
  return Find(references, name);
}

const ModelAnswer* AccuracyResult::Model(const std::string& name) const {
  return Find(models, name);
}

absl::StatusOr<std::vector<AccuracyResult>> RunAccuracyCase(
    const AccuracyCase& problem, const std::vector<double>& poisson_ratios,
    const std::string& folder, const std::function<void(const std::string&)>& on_step) {
  std::vector<AccuracyResult> results;
  std::map<std::string, ModelAnswer> same_for_all;
  for (const double poisson_ratio : poisson_ratios) {
    on_step(absl::StrCat(problem.name, ", nu = ", poisson_ratio, " ..."));
    AccuracyResult result;
    result.poisson_ratio = poisson_ratio;
    TF_ASSIGN_OR_RETURN(result.references,
                        AnswerByReferences(problem, poisson_ratio, folder, on_step));
    TF_ASSIGN_OR_RETURN(result.models, AnswerByAllModels(problem, poisson_ratio, &same_for_all));
    results.push_back(std::move(result));
  }
  return results;
}

double LargestDisplacement(const AccuracyCase& problem, const ModelAnswer& reference) {
  return (reference.positions - problem.mesh.positions()).rowwise().norm().maxCoeff();
}

}  // namespace tissueform
