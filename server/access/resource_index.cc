// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/access/resource_index.h"

namespace tissueform {
namespace {

template <typename Map, typename Key>
const typename Map::mapped_type* FindIn(const Map& map, const Key& key) {
  const auto found = map.find(key);
  return found == map.end() ? nullptr : &found->second;
}

}  // namespace

void ResourceIndex::Add(const SessionRecord& record) {
  RemoveSession(record.id);
  sessions_[record.id] = {
      .owner = record.owner, .project = record.project, .mesh = record.mesh_sha256};
  sessions_of_mesh_[record.mesh_sha256].insert(record.id);
}

void ResourceIndex::Add(const PredictionRecord& record) {
  RemovePrediction(record.id);
  predictions_[record.id] = {
      .owner = record.owner, .session = record.session, .mesh = record.mesh_sha256};
  predictions_of_mesh_[record.mesh_sha256].insert(record.id);
}

void ResourceIndex::Add(const CaseRecord& record) {
  RemoveCase(record.key());
  cases_[record.key()] = {.project = record.project};
}

void ResourceIndex::RemoveSession(const std::string& id) {
  const auto found = sessions_.find(id);
  if (found == sessions_.end()) return;
  Forget(&sessions_of_mesh_, found->second.mesh, id);
  sessions_.erase(found);
}

void ResourceIndex::RemovePrediction(const std::string& id) {
  const auto found = predictions_.find(id);
  if (found == predictions_.end()) return;
  Forget(&predictions_of_mesh_, found->second.mesh, id);
  predictions_.erase(found);
}

void ResourceIndex::RemoveCase(const CaseKey& key) {
  const auto found = cases_.find(key);
  if (found == cases_.end()) return;
  cases_.erase(found);
}

const ResourceIndex::Session* ResourceIndex::FindSession(const std::string& id) const {
  return FindIn(sessions_, id);
}
const ResourceIndex::Prediction* ResourceIndex::FindPrediction(const std::string& id) const {
  return FindIn(predictions_, id);
}
const ResourceIndex::Case* ResourceIndex::FindCase(const CaseKey& key) const {
  return FindIn(cases_, key);
}

const std::set<std::string>& ResourceIndex::SessionsOf(const std::string& mesh) const {
  return Of(sessions_of_mesh_, mesh);
}
const std::set<std::string>& ResourceIndex::PredictionsOf(const std::string& mesh) const {
  return Of(predictions_of_mesh_, mesh);
}

void ResourceIndex::Forget(NamesOf* names, const std::string& of, const std::string& id) {
  const auto found = names->find(of);
  found->second.erase(id);
  if (found->second.empty()) names->erase(found);
}

const std::set<std::string>& ResourceIndex::Of(const NamesOf& names, const std::string& of) {
  static const auto* none = new std::set<std::string>();
  const std::set<std::string>* found = FindIn(names, of);
  return found == nullptr ? *none : *found;
}

}  // namespace tissueform
