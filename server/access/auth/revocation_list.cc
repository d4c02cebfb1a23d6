// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/access/auth/revocation_list.h"

#include <algorithm>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "nlohmann/json.hpp"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr size_t kDigestDigits = 64;

using StringSet = absl::flat_hash_set<std::string>;

absl::Status ReadStrings(const nlohmann::json& array, absl::string_view name, StringSet* into) {
  const bool strings =
      array.is_array() && std::all_of(array.begin(), array.end(), [](const nlohmann::json& item) {
        return item.is_string() && !item.get_ref<const std::string&>().empty();
      });
  if (!strings) {
    return absl::InvalidArgumentError(absl::StrCat("\"", name, "\" is not a list of strings"));
  }
  for (const nlohmann::json& item : array) into->insert(item.get<std::string>());
  return absl::OkStatus();
}

absl::Status CheckDigests(const StringSet& digests) {
  const bool whole = std::all_of(digests.begin(), digests.end(), [](const std::string& digest) {
    return digest.size() == kDigestDigits &&
           std::all_of(digest.begin(), digest.end(), [](unsigned char c) {
             return absl::ascii_isdigit(c) || (c >= 'a' && c <= 'f');
           });
  });
  if (whole) return absl::OkStatus();
  return absl::InvalidArgumentError(
      "a token digest is not 64 lower-case hexadecimal digits; copy it from `tissueform token "
      "show`");
}

absl::StatusOr<std::chrono::system_clock::time_point> TimeOfText(const nlohmann::json& text) {
  absl::Time time;
  std::string error;
  if (text.is_string() &&
      absl::ParseTime(absl::RFC3339_full, text.get_ref<const std::string&>(), &time, &error)) {
    return absl::ToChronoTime(time);
  }
  return absl::InvalidArgumentError(
      "a principal's time does not have the form \"2026-11-23T12:00:00Z\"");
}

}  // namespace

absl::StatusOr<std::shared_ptr<const RevocationList>> RevocationList::Parse(
    absl::string_view text) {
  if (text.size() > kMaxBytes) return absl::InvalidArgumentError("it is larger than 8 MiB");
  const nlohmann::json object = nlohmann::json::parse(text.begin(), text.end(), nullptr, false);
  if (!object.is_object()) return absl::InvalidArgumentError("it is not a JSON object");
  auto list = std::make_shared<RevocationList>();
  for (const auto& [name, value] : object.items()) {
    if (name == "token_digests") {
      TF_RETURN_IF_ERROR(ReadStrings(value, name, &list->digests_));
    } else if (name == "token_ids") {
      TF_RETURN_IF_ERROR(ReadStrings(value, name, &list->ids_));
    } else if (name == "principals" && value.is_object()) {
      for (const auto& [principal, before] : value.items()) {
        TF_ASSIGN_OR_RETURN(list->principals_[principal], TimeOfText(before));
      }
    } else {
      return absl::InvalidArgumentError(
          "it has an unknown member; allowed: \"token_digests\", \"token_ids\" (lists) and "
          "\"principals\" (an object)");
    }
  }
  TF_RETURN_IF_ERROR(CheckDigests(list->digests_));
  return list;
}

bool RevocationList::Holds(const Authenticated& authenticated) const {
  if (digests_.contains(authenticated.token_id)) return true;
  if (!authenticated.token_name.empty() && ids_.contains(authenticated.token_name)) return true;
  const auto principal = principals_.find(authenticated.principal->name);
  return principal != principals_.end() && authenticated.issued < principal->second;
}

}  // namespace tissueform
