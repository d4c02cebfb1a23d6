// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/integration/model_case_calls.h"

#include <array>
#include <map>
#include <random>
#include <vector>

#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"
#include "proto/conversion/case_conversion.h"
#include "tests/integration/model_choices.h"

namespace tissueform::testing {
namespace {

constexpr std::array<size_t, kModelCases> kCaseBytes = {1, 5'000, 1'200'000, 524'288};

// Mostly one of the model's, whether the server has it or not.
std::string SomeCase(uint32_t number) {
  if (number % 8 != 0) return NameOfCase(static_cast<int>(number / 8 % kModelCases));
  return number / 8 % 2 == 0 ? "cases/no name" : "cases/" + std::string(64, '0');
}

Outcome OfCase(const ModelState& state, const std::string& name) {
  if (!ParseCaseName(name).ok()) return kInvalidRequest;
  if (state.model.cases.contains(name)) return kFine;
  return {absl::StatusCode::kNotFound, ErrorReason::kCaseNotFound};
}

}  // namespace

std::string BytesOfCase(int number) {
  std::mt19937 random(static_cast<unsigned>(number));
  std::string bytes(kCaseBytes.at(static_cast<size_t>(number)), '\0');
  for (char& byte : bytes) byte = static_cast<char>(random());
  return bytes;
}

std::string NameOfCase(int number) { return CaseName(Sha256Hex({BytesOfCase(number)})); }

absl::Status UploadCase(ModelState& state, const Numbers& numbers) {
  const int number = static_cast<int>(numbers[0] % kModelCases);
  const std::string name = NameOfCase(number);
  const std::string title = numbers[1] % 8 == 0 ? "two\nlines" : absl::StrCat("t", numbers[1] % 3);
  state.Log("UploadCase(", number, ", ", title, ")");
  std::map<std::string, v1::Case>& cases = state.model.cases;
  // The client asks for the case before it sends a header.
  const bool is_there = cases.contains(name);
  Outcome expected = kFine;
  if (!is_there && cases.size() == kMaxCases) {
    expected = {absl::StatusCode::kResourceExhausted, ErrorReason::kTooManyCases};
  }
  if (!is_there && title == "two\nlines") expected = kInvalidRequest;
  const auto reported = state.client->cases().Upload(BytesOfCase(number), title);
  TF_RETURN_IF_ERROR(CheckOutcome(expected, reported.status()));
  if (!reported.ok()) return absl::OkStatus();
  if (is_there) return CheckSame(cases.at(name), *reported);
  if (reported->name() != name || reported->title() != title ||
      reported->total_bytes() != static_cast<int64_t>(BytesOfCase(number).size())) {
    return Wrong(reported->DebugString());
  }
  cases[name] = *reported;
  return absl::OkStatus();
}

absl::Status ReadCase(ModelState& state, const Numbers& numbers) {
  const std::string name = SomeCase(numbers[0]);
  state.Log("GetCase and ReadCase(", name, ")");
  const Outcome expected = OfCase(state, name);
  const absl::StatusOr<v1::Case> reported = state.client->cases().Get(name);
  TF_RETURN_IF_ERROR(CheckOutcome(expected, reported.status()));
  const absl::StatusOr<std::string> bytes = state.client->cases().Read(name);
  TF_RETURN_IF_ERROR(CheckOutcome(expected, bytes.status()));
  if (!expected.ok()) return absl::OkStatus();
  // Its digest is its name, which Read compares.
  return CheckSame(state.model.cases.at(name), *reported);
}

absl::Status ListCases(ModelState& state, const Numbers& numbers) {
  v1::ListCasesRequest request;
  request.set_page_size(SomePageSize(numbers[0]));
  state.Log("ListCases(", request.page_size(), ")");
  const auto names = ReadPages<v1::ListCasesRequest, v1::ListCasesResponse>(
      request,
      [&state](grpc::ClientContext* context, const v1::ListCasesRequest& page_request,
               v1::ListCasesResponse* page) {
        return state.cases->ListCases(context, page_request, page);
      },
      [](const v1::ListCasesResponse& page) {
        std::vector<std::string> of_page;
        for (const v1::Case& one : page.cases()) of_page.push_back(one.name());
        return of_page;
      });
  std::vector<std::string> expected;
  for (const auto& [name, reported] : state.model.cases) expected.push_back(name);
  return CheckPages(request.page_size(), names, expected);
}

absl::Status DeleteCase(ModelState& state, const Numbers& numbers) {
  const std::string name = SomeCase(numbers[0]);
  state.Log("DeleteCase(", name, ")");
  TF_RETURN_IF_ERROR(CheckOutcome(OfCase(state, name), state.client->cases().Delete(name)));
  state.model.cases.erase(name);
  return absl::OkStatus();
}

absl::Status CheckCases(const std::vector<v1::Case>& listed, ServedModel* model) {
  if (listed.size() != model->cases.size()) {
    return Wrong("there must be ", model->cases.size(), " cases, but there are ", listed.size());
  }
  for (const v1::Case& reported : listed) {
    const auto known = model->cases.find(reported.name());
    if (known == model->cases.end()) return Wrong(reported.name(), " must not be there");
    if (!known->second.has_create_time()) {
      *known->second.mutable_create_time() = reported.create_time();
    }
    TF_RETURN_IF_ERROR(CheckSame(known->second, reported));
  }
  return absl::OkStatus();
}

}  // namespace tissueform::testing
