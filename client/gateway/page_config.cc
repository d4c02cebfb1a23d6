// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/page_config.h"

#include "absl/strings/str_cat.h"
#include "nlohmann/json.hpp"

#include "core/base/status_macros.h"
#include "core/planning/outcome/deviations.h"

namespace tissueform {

absl::StatusOr<std::string> PageConfigJson(const LoginConfig& login,
                                           const std::string& deviations) {
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  if (!login.issuer.empty()) {
    json["oidc"] = {{"issuer", login.issuer},
                    {"client_id", login.client_id},
                    {"audience", login.audience},
                    {"scope", login.scopes}};
  }
  if (!deviations.empty()) {
    TF_ASSIGN_OR_RETURN(const DeviationTable table, ReadDeviations(deviations));
    json["deviations"] = DeviationTableToJson(table);
  }
  return absl::StrCat(json.dump(), "\n");
}

}  // namespace tissueform
