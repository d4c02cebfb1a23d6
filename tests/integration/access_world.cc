// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/integration/access_world.h"

#include <algorithm>

namespace tissueform::testing {

AccessWorld::Level AccessWorld::Shared(const std::string& owner, const std::string& resource,
                                       const std::string& project,
                                       const std::string& principal) const {
  Level level = kNothing;
  for (const std::string& name : {resource, "projects/" + project}) {
    const auto share = shares.find({owner, name, principal});
    if (name != "projects/" && share != shares.end()) level = std::max(level, share->second);
  }
  return level;
}

bool AccessWorld::IsGood(const std::string& link) const {
  const auto found = links.find(link);
  return found != links.end() && sessions.contains(found->second.session) &&
         OfSession({found->second.maker, ""}, found->second.session) >= kDrag;
}

AccessWorld::Level AccessWorld::OfSession(const Caller& caller, const std::string& name) const {
  const auto found = sessions.find(name);
  if (found == sessions.end()) return kNothing;
  if (!caller.link.empty()) {
    return IsGood(caller.link) && links.at(caller.link).session == name ? kLook : kNothing;
  }
  if (found->second.owner == caller.name) return kOwn;
  return Shared(found->second.owner, name, found->second.project, caller.name);
}

AccessWorld::Level AccessWorld::OfPrediction(const Caller& caller, const std::string& name) const {
  const auto found = predictions.find(name);
  if (found == predictions.end() || !caller.link.empty()) return kNothing;
  const Prediction& prediction = found->second;
  if (prediction.owner == caller.name) return kOwn;
  if (Shared(prediction.owner, name, "", caller.name) != kNothing) return kLook;
  if (IsBridge(caller) && IsExported(name)) return kLook;
  const auto session = sessions.find(prediction.session);
  if (session == sessions.end() || session->second.owner != prediction.owner) return kNothing;
  return OfSession(caller, prediction.session) == kNothing ? kNothing : kLook;
}

AccessWorld::Level AccessWorld::OfCaseAlone(const std::string& principal,
                                            const std::string& name) const {
  if (cases.contains({name, principal})) return kOwn;
  for (const auto& [key, project] : cases) {
    if (key.first == name && Shared(key.second, name, project, principal) != kNothing) {
      return kLook;
    }
  }
  return kNothing;
}

AccessWorld::Level AccessWorld::OfCase(const Caller& caller, const std::string& name) const {
  if (!caller.link.empty()) {
    if (!IsGood(caller.link)) return kNothing;
    const std::string& session = links.at(caller.link).session;
    for (const auto& [token, link] : links) {
      if (link.session != session || link.case_name != name || !IsGood(token)) continue;
      // The maker's of the first such link decides.
      if (OfCaseAlone(link.maker, name) != kNothing) return kLook;
    }
    return kNothing;
  }
  const Level alone = OfCaseAlone(caller.name, name);
  if (alone != kNothing || !IsBridge(caller)) return alone;
  for (const auto& [id, prediction] : exports) {
    const Prediction& of = predictions.at(prediction);
    if (of.case_name == name && OfCaseAlone(of.owner, name) != kNothing) return kLook;
  }
  return kNothing;
}

bool AccessWorld::IsExported(const std::string& prediction) const {
  return std::ranges::any_of(exports, [&](const auto& of) { return of.second == prediction; });
}

AccessWorld::Level AccessWorld::OfExport(const Caller& caller, const std::string& name) const {
  const auto found = exports.find(name);
  if (found == exports.end() || !caller.link.empty()) return kNothing;
  if (predictions.at(found->second).owner == caller.name) return kOwn;
  return IsBridge(caller) ? kLook : kNothing;
}

AccessWorld::Level AccessWorld::OfMesh(const Caller& caller, const std::string& name) const {
  if (!meshes.contains(name)) return kNothing;
  if (caller.link.empty() && senders.contains({name, caller.name})) return kOwn;
  for (const auto& [id, session] : sessions) {
    if (session.mesh == name && OfSession(caller, id) != kNothing) return kLook;
  }
  for (const auto& [id, prediction] : predictions) {
    if (prediction.mesh == name && OfPrediction(caller, id) != kNothing) return kLook;
  }
  return kNothing;
}

AccessWorld::Level AccessWorld::Of(const Caller& caller, Kind kind, const std::string& name) const {
  switch (kind) {
    case Kind::kSession:
      return OfSession(caller, name);
    case Kind::kPrediction:
      return OfPrediction(caller, name);
    case Kind::kCase:
      return OfCase(caller, name);
    case Kind::kExport:
      return OfExport(caller, name);
    case Kind::kMesh:
      break;
  }
  return OfMesh(caller, name);
}

std::set<std::string> AccessWorld::Listed(const Caller& caller, Kind kind) const {
  std::set<std::string> names;
  for (const auto& [name, session] : sessions) {
    if (kind == Kind::kSession && OfSession(caller, name) != kNothing) names.insert(name);
  }
  for (const auto& [name, prediction] : predictions) {
    if (kind == Kind::kPrediction && OfPrediction(caller, name) != kNothing) names.insert(name);
  }
  for (const auto& [key, project] : cases) {
    if (kind == Kind::kCase && OfCase(caller, key.first) != kNothing) names.insert(key.first);
  }
  for (const auto& [name, prediction] : exports) {
    if (kind == Kind::kExport && OfExport(caller, name) != kNothing) names.insert(name);
  }
  for (const std::string& name : meshes) {
    if (kind == Kind::kMesh && OfMesh(caller, name) != kNothing) names.insert(name);
  }
  return names;
}

void AccessWorld::DropShares(const std::string& owner, const std::string& resource) {
  std::erase_if(shares, [&](const auto& share) {
    return std::get<0>(share.first) == owner && std::get<1>(share.first) == resource;
  });
}

void AccessWorld::DeleteSession(const std::string& name) {
  DropShares(sessions.at(name).owner, name);
  std::erase_if(links, [&](const auto& link) { return link.second.session == name; });
  sessions.erase(name);
}

void AccessWorld::DeletePrediction(const std::string& name) {
  DropShares(predictions.at(name).owner, name);
  std::erase_if(exports, [&](const auto& of) { return of.second == name; });
  predictions.erase(name);
}

void AccessWorld::DeleteCase(const std::string& name, const std::string& owner) {
  DropShares(owner, name);
  cases.erase({name, owner});
}

void AccessWorld::DeleteMesh(const Caller& caller, const std::string& name) {
  senders.erase({name, caller.name});
  const bool others =
      std::ranges::any_of(senders, [&](const auto& of) { return of.first == name; }) ||
      std::ranges::any_of(sessions,
                          [&](const auto& session) { return session.second.mesh == name; });
  if (!others) meshes.erase(name);
}

int AccessWorld::SessionsOf(const std::string& owner, const std::string& mesh) const {
  return static_cast<int>(std::ranges::count_if(sessions, [&](const auto& session) {
    return session.second.owner == owner && session.second.mesh == mesh;
  }));
}

}  // namespace tissueform::testing
