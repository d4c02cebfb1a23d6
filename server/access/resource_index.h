// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>

#include "server/store/case_store.h"
#include "server/store/prediction_store.h"
#include "server/store/session_record.h"

namespace tissueform {

// What there is, and whose: of all that a store keeps, without its content. Not thread-safe.
class ResourceIndex {
 public:
  struct Session {
    std::string owner = {};
    std::string project = {};
    std::string mesh = {};
  };
  struct Prediction {
    std::string owner = {};
    std::string session = {};  // that it was made in; it may be gone, or be another's by now
    std::string mesh = {};
  };
  struct Case {
    std::string project = {};
  };

  void Add(const SessionRecord& record);
  void Add(const PredictionRecord& record);
  void Add(const CaseRecord& record);
  void RemoveSession(const std::string& id);
  void RemovePrediction(const std::string& id);
  void RemoveCase(const CaseKey& key);

  // Null where there is none.
  const Session* FindSession(const std::string& id) const;
  const Prediction* FindPrediction(const std::string& id) const;
  const Case* FindCase(const CaseKey& key) const;

  const std::map<std::string, Session>& sessions() const { return sessions_; }
  const std::map<std::string, Prediction>& predictions() const { return predictions_; }
  const std::map<CaseKey, Case>& cases() const { return cases_; }

  // Sessions and predictions that hold a mesh.
  const std::set<std::string>& SessionsOf(const std::string& mesh) const;
  const std::set<std::string>& PredictionsOf(const std::string& mesh) const;

 private:
  using NamesOf = std::map<std::string, std::set<std::string>>;

  static void Forget(NamesOf* names, const std::string& of, const std::string& id);
  static const std::set<std::string>& Of(const NamesOf& names, const std::string& of);

  std::map<std::string, Session> sessions_;
  std::map<std::string, Prediction> predictions_;
  std::map<CaseKey, Case> cases_;
  NamesOf sessions_of_mesh_;
  NamesOf predictions_of_mesh_;
};

}  // namespace tissueform
