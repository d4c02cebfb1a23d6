// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"

#include "client/cpp/client_call.h"
#include "client/cpp/tissueform_client.h"
#include "core/base/status_macros.h"
#include "tests/integration/durable_server.h"
#include "tests/integration/model_answers.h"
#include "tests/integration/served_model.h"

namespace tissueform::testing {

inline constexpr int kMaxSessions = 5;  // of the server

// Choose what a call asks for among what there is then; so every part of a sequence of calls is a
// sequence.
using Numbers = std::array<uint32_t, 4>;

// A model and the connection to the server that it is of.
struct ModelState {
  // To the server that runs now.
  absl::Status Connect(const DurableServer& server);
  void Disconnect();

  // Mostly one that there is.
  std::string SomeSession(uint32_t number) const;
  std::string SomePrediction(uint32_t number) const;

  template <typename... Words>
  void Log(const Words&... words) {
    log.push_back(absl::StrCat(words...));
  }

  std::unique_ptr<TissueformClient> client;
  std::unique_ptr<v1::MeshService::Stub> meshes;
  std::unique_ptr<v1::SessionService::Stub> sessions;
  std::unique_ptr<v1::PredictionService::Stub> predictions;
  std::unique_ptr<v1::CaseService::Stub> cases;
  ServedModel model;
  ModelAnswers answers;
  std::set<std::string> etags;   // all that were
  std::vector<std::string> log;  // what was called, in words; the last one is that which failed
};

// The server has answered something else than the model.
template <typename... Words>
absl::Status Wrong(const Words&... words) {
  return absl::InternalError(absl::StrCat(words...));
}

absl::Status CheckSame(const google::protobuf::Message& expected,
                       const google::protobuf::Message& got);
absl::Status CheckSession(const std::string& name, const ServedSession& expected,
                          v1::Session reported);
// What is asked for; the session's own model when unspecified.
AnswerQuestionKey KeyOf(const ServedSession& session, v1::DeformationModel model, int pose);

// All pages of `list`, each as large as asked for at most, by their names.
template <typename Request, typename Page, typename Names>
absl::StatusOr<std::vector<std::string>> ReadPages(
    Request request,
    const std::function<grpc::Status(grpc::ClientContext*, const Request&, Page*)>& list,
    const Names& names_of) {
  std::vector<std::string> names;
  do {
    grpc::ClientContext context;
    Page page;
    TF_RETURN_IF_ERROR(FromGrpcStatus(list(&context, request, &page)));
    const std::vector<std::string> more = names_of(page);
    if (request.page_size() > 0 && static_cast<int>(more.size()) > request.page_size()) {
      return Wrong("a page has more than was asked for");
    }
    names.insert(names.end(), more.begin(), more.end());
    request.set_page_token(page.next_page_token());
  } while (!request.page_token().empty());
  return names;
}

absl::Status CheckPages(int32_t page_size, const absl::StatusOr<std::vector<std::string>>& names,
                        const std::vector<std::string>& expected);

}  // namespace tissueform::testing
