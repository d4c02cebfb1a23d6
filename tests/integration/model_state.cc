// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/integration/model_state.h"

#include "absl/strings/str_join.h"
#include "grpcpp/create_channel.h"

#include "proto/conversion/model_conversion.h"
#include "tests/integration/model_choices.h"

namespace tissueform::testing {

absl::Status ModelState::Connect(const DurableServer& server) {
  TF_ASSIGN_OR_RETURN(client, server.Connect());
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  const auto channel =
      grpc::CreateCustomChannel(server.address(), grpc::InsecureChannelCredentials(), arguments);
  meshes = v1::MeshService::NewStub(channel);
  sessions = v1::SessionService::NewStub(channel);
  predictions = v1::PredictionService::NewStub(channel);
  cases = v1::CaseService::NewStub(channel);
  return absl::OkStatus();
}

void ModelState::Disconnect() {
  cases.reset();
  predictions.reset();
  sessions.reset();
  meshes.reset();
  client.reset();
}

std::string ModelState::SomeSession(uint32_t number) const {
  if (number % 8 != 0 && !model.sessions.empty()) return NthName(model.sessions, number / 8);
  switch (number / 8 % 4) {
    case 0:
      return "sessions/no name";
    case 1:
      return "sessions/none";
    default:
      return SessionName(ChosenId(number / 32 % 4));
  }
}

std::string ModelState::SomePrediction(uint32_t number) const {
  if (number % 8 != 0 && !model.predictions.empty()) {
    return NthName(model.predictions, number / 8);
  }
  return number / 8 % 2 == 0 ? "predictions/no name" : "predictions/none";
}

absl::Status CheckSame(const google::protobuf::Message& expected,
                       const google::protobuf::Message& got) {
  if (expected.SerializeAsString() == got.SerializeAsString()) return absl::OkStatus();
  return Wrong("must be\n", expected.DebugString(), "but is\n", got.DebugString());
}

// What the server measures is not predicted.
absl::Status CheckSession(const std::string& name, const ServedSession& expected,
                          v1::Session reported) {
  ClearMeasured(&reported);
  return CheckSame(ExpectedSession(name, expected), reported);
}

AnswerQuestionKey KeyOf(const ServedSession& session, v1::DeformationModel model, int pose) {
  return {.mesh = session.mesh,
          .recipe = RecipeKey(session.recipe),
          .model = model == kOwnModel ? ToProto(session.recipe.model) : model,
          .pose = pose};
}

absl::Status CheckPages(int32_t page_size, const absl::StatusOr<std::vector<std::string>>& names,
                        const std::vector<std::string>& expected) {
  TF_RETURN_IF_ERROR(CheckOutcome(page_size < 0 ? kInvalidRequest : kFine, names.status()));
  if (!names.ok() || *names == expected) return absl::OkStatus();
  return Wrong("must be ", absl::StrJoin(expected, ", "), ", but is ", absl::StrJoin(*names, ", "));
}

}  // namespace tissueform::testing
