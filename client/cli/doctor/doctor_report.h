// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "nlohmann/json.hpp"

namespace tissueform {

// How one question of the doctor was answered.
enum class Finding { kOk, kWarning, kFailed, kSkipped };

struct DoctorLine {
  std::string check;  // "name", "route", ...; programs may decide by it
  Finding finding = Finding::kOk;
  std::string text = {};    // what was found
  std::string advice = {};  // what to do; empty where nothing is
};

// All of them, in their order.
class DoctorReport {
 public:
  void Add(DoctorLine line) { lines_.push_back(std::move(line)); }

  const std::vector<DoctorLine>& lines() const { return lines_; }
  bool failed() const;
  // Of the last line.
  bool last_failed() const { return !lines_.empty() && lines_.back().finding == Finding::kFailed; }

  // A line each, what to do below it.
  std::string Text() const;
  // {"server", "healthy", "checks": [{"check", "finding", "text", "advice"}]}
  nlohmann::ordered_json Json(const std::string& server) const;

 private:
  std::vector<DoctorLine> lines_;
};

}  // namespace tissueform
