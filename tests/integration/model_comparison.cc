// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/integration/model_comparison.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <optional>
#include <utility>

#include "absl/strings/str_join.h"

#include "core/base/status_macros.h"
#include "proto/conversion/mesh_conversion.h"
#include "proto/conversion/prediction_conversion.h"
#include "tests/integration/model_answer_calls.h"
#include "tests/integration/model_case_calls.h"
#include "tests/integration/model_choices.h"

namespace tissueform::testing {
namespace {

// All that can be asked for.
struct Listed {
  std::vector<v1::Mesh> meshes;
  std::vector<v1::Session> sessions;
  std::vector<v1::Prediction> predictions;
  std::vector<v1::Case> cases;
};
absl::StatusOr<Listed> ListAll(ModelState& state) {
  Listed listed;
  TF_ASSIGN_OR_RETURN(listed.meshes, state.client->ListMeshes());
  TF_ASSIGN_OR_RETURN(listed.sessions, state.client->ListSessions());
  TF_ASSIGN_OR_RETURN(listed.predictions, state.client->predictions().List());
  TF_ASSIGN_OR_RETURN(listed.cases, state.client->cases().List());
  return listed;
}

absl::Status Matches(const std::set<std::string>& etags, const Listed& listed, ServedModel* model) {
  if (listed.meshes.size() != model->meshes.size() ||
      listed.sessions.size() != model->sessions.size() ||
      listed.predictions.size() != model->predictions.size()) {
    return Wrong("there must be ", model->meshes.size(), " meshes, ", model->sessions.size(),
                 " sessions and ", model->predictions.size(), " predictions, but there are ",
                 listed.meshes.size(), ", ", listed.sessions.size(), " and ",
                 listed.predictions.size());
  }
  for (const v1::Mesh& mesh : listed.meshes) {
    if (!model->meshes.contains(mesh.name())) return Wrong(mesh.name(), " must not be there");
  }
  for (const v1::Session& reported : listed.sessions) {
    ServedSession* session = model->Find(reported.name());
    if (session == nullptr) return Wrong(reported.name(), " must not be there");
    if (session->etag.empty() && !etags.contains(reported.etag())) session->etag = reported.etag();
    if (session->create_time == 0) session->create_time = reported.create_time().seconds();
    TF_RETURN_IF_ERROR(CheckSession(reported.name(), *session, reported));
  }
  for (const v1::Prediction& reported : listed.predictions) {
    const auto known = model->predictions.find(reported.name());
    if (known == model->predictions.end()) return Wrong(reported.name(), " must not be there");
    TF_RETURN_IF_ERROR(CheckSame(known->second.reported, reported));
  }
  return CheckCases(listed.cases, model);
}

}  // namespace

absl::Status SolveAll(ModelState& state) {
  for (auto& [name, session] : state.model.sessions) {
    state.Log("DeformOnce(", name, ") at the end");
    const int pose = session.pose.value_or(0);
    TF_ASSIGN_OR_RETURN(const v1::DeformOnceResponse reported,
                        state.client->DeformOnce(name, {{session.handle(), SomePose(pose)}}));
    TF_ASSIGN_OR_RETURN(const Positions answer,
                        DecodePositions(reported.positions(), MeshOfModel(0).mesh.num_vertices()));
    TF_RETURN_IF_ERROR(state.answers.Check(KeyOf(session, kOwnModel, pose), answer));
    session.ready = true;
  }
  return absl::OkStatus();
}

absl::Status CompareAll(ModelState& state, const std::vector<ServedModel>& possible) {
  state.Log("all is compared");
  TF_ASSIGN_OR_RETURN(const Listed listed, ListAll(state));
  absl::Status wrong;
  for (ServedModel model : possible) {
    wrong = Matches(state.etags, listed, &model);
    if (!wrong.ok()) continue;
    state.model = std::move(model);
    for (const auto& [name, session] : state.model.sessions) state.etags.insert(session.etag);
    break;
  }
  TF_RETURN_IF_ERROR(wrong);
  for (const auto& [name, prediction] : state.model.predictions) {
    TF_ASSIGN_OR_RETURN(const Positions answer, state.client->predictions().ReadPositions(name));
    TF_RETURN_IF_ERROR(state.answers.Check(prediction.key, answer));
  }
  for (const auto& [name, reported] : state.model.cases) {
    TF_RETURN_IF_ERROR(state.client->cases().Read(name).status());  // compares the digest
  }
  return absl::OkStatus();
}

namespace {

// A case that the model does not have yet, or nothing where the server takes no more.
Change SendCase(const ModelState& state, int number, ServedModel* after) {
  const std::string name = NameOfCase(number);
  if (state.model.cases.contains(name) || state.model.cases.size() == kMaxCases) return nullptr;
  std::string bytes = BytesOfCase(number);
  v1::Case& sent = after->cases[name];
  sent.set_name(name);
  sent.set_total_bytes(static_cast<int64_t>(bytes.size()));
  return [client = state.client.get(), bytes = std::move(bytes)] {
    UploadOptions options;
    options.give_up_after = std::chrono::milliseconds(0);
    return client->cases().Upload(bytes, "", options).status();
  };
}

}  // namespace

Change SomeChange(const ModelState& state, const Numbers& numbers, ServedModel* after) {
  if (numbers[0] % 4 == 3) {
    return SendCase(state, static_cast<int>(numbers[1] % kModelCases), after);
  }
  TissueformClient* const client = state.client.get();
  const std::string name =
      state.model.sessions.empty() ? "" : NthName(state.model.sessions, numbers[1]);
  ServedSession* session = after->Find(name);
  if (session == nullptr) return nullptr;
  switch (numbers[0] % 4) {
    case 0:
      after->sessions.erase(name);
      return [=] { return client->DeleteSession(name); };
    case 1: {
      ModelUpdate update = SomeUpdate(numbers[2] % 5);
      update.request.set_name(name);
      update.request.set_etag(session->etag);
      Apply(update.request, session);
      return [=] { return client->UpdateSession(update.request).status(); };
    }
    default: {
      const int pose = SomePoseNumber(numbers[2]);
      session->pose = pose;
      return [=, handle = session->handle()] {
        uint64_t committed = 0;
        const auto any = [](const v1::DeformFrame&) { return absl::OkStatus(); };
        const absl::Status status = DragOnce(client, name, handle, {pose}, 1, any, &committed);
        // The frame may be lost where the commit is not.
        return committed == 1 ? absl::OkStatus() : status;
      };
    }
  }
}

}  // namespace tissueform::testing
