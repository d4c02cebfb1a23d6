// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/doctor/doctor_report.h"

#include <algorithm>

#include "absl/strings/ascii.h"
#include "absl/strings/str_format.h"

namespace tissueform {
namespace {

const char* NameOf(Finding finding) {
  switch (finding) {
    case Finding::kOk:
      return "ok";
    case Finding::kWarning:
      return "warning";
    case Finding::kFailed:
      return "failed";
    case Finding::kSkipped:
      return "skipped";
  }
  return "";
}

// What servers and libraries say may hold anything; a terminal and JSON get printable ASCII of it.
std::string Printable(const std::string& text) {
  constexpr size_t kMax = 500;
  std::string printable = text.substr(0, kMax);
  std::replace_if(
      printable.begin(), printable.end(), [](unsigned char c) { return !absl::ascii_isprint(c); },
      '?');
  return printable;
}

}  // namespace

bool DoctorReport::failed() const {
  return std::any_of(lines_.begin(), lines_.end(),
                     [](const DoctorLine& line) { return line.finding == Finding::kFailed; });
}

std::string DoctorReport::Text() const {
  std::string text;
  for (const DoctorLine& line : lines_) {
    const std::string finding = NameOf(line.finding);
    absl::StrAppendFormat(
        &text, "%-8s %-11s %s\n",
        line.finding == Finding::kFailed ? absl::AsciiStrToUpper(finding) : finding, line.check,
        Printable(line.text));
    if (!line.advice.empty())
      absl::StrAppendFormat(&text, "%20s -> %s\n", "", Printable(line.advice));
  }
  return text;
}

nlohmann::ordered_json DoctorReport::Json(const std::string& server) const {
  nlohmann::ordered_json json = {{"server", Printable(server)},
                                 {"healthy", !failed()},
                                 {"checks", nlohmann::ordered_json::array()}};
  for (const DoctorLine& line : lines_) {
    json["checks"].push_back({{"check", line.check},
                              {"finding", NameOf(line.finding)},
                              {"text", Printable(line.text)},
                              {"advice", Printable(line.advice)}});
  }
  return json;
}

}  // namespace tissueform
