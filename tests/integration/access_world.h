// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <map>
#include <set>
#include <string>
#include <tuple>
#include <utility>

namespace tissueform::testing {

// Who may what, said once more and as plainly as it can be: what the server's answers are compared
// with. It shares no code with the server.
struct AccessWorld {
  enum Level { kNothing, kLook, kDrag, kOwn };
  enum class Kind { kSession, kPrediction, kCase, kMesh, kExport };

  struct Session {
    std::string owner;
    std::string project;
    std::string mesh;
  };
  struct Prediction {
    std::string owner;
    std::string session;
    std::string mesh;
    std::string case_name = {};  // may be empty, and of any owner
  };
  struct Link {
    std::string session;
    std::string maker;
    std::string case_name;  // may be empty
  };
  // The caller: a principal, or the bearer of a link.
  struct Caller {
    std::string name;
    std::string link;  // its token; empty: none

    friend bool operator==(const Caller&, const Caller&) = default;
  };

  // By full names ("sessions/{id}").
  std::map<std::string, Session> sessions;
  std::map<std::string, Prediction> predictions;
  std::map<std::pair<std::string, std::string>, std::string> cases;  // name and owner: project
  std::set<std::string> meshes;                                      // that the server has
  std::set<std::pair<std::string, std::string>> senders;             // of a mesh: name, principal
  std::map<std::tuple<std::string, std::string, std::string>, Level>
      shares;                                  // owner, resource, principal
  std::map<std::string, Link> links;           // by token
  std::map<std::string, std::string> exports;  // of which prediction

  static bool IsBridge(const Caller& caller) {
    return caller.link.empty() && caller.name == "BRIDGE";
  }

  bool IsGood(const std::string& link) const;
  Level Of(const Caller& caller, Kind kind, const std::string& name) const;
  // All that the caller sees in a list, rising.
  std::set<std::string> Listed(const Caller& caller, Kind kind) const;

  void DeleteSession(const std::string& name);
  void DeletePrediction(const std::string& name);
  void DeleteCase(const std::string& name, const std::string& owner);
  // REQUIRES: Of(caller, kMesh, name) is kOwn and SessionsOf(caller, name) is 0.
  void DeleteMesh(const Caller& caller, const std::string& name);
  int SessionsOf(const std::string& owner, const std::string& mesh) const;

 private:
  Level Shared(const std::string& owner, const std::string& resource, const std::string& project,
               const std::string& principal) const;
  Level OfSession(const Caller& caller, const std::string& name) const;
  Level OfPrediction(const Caller& caller, const std::string& name) const;
  Level OfCase(const Caller& caller, const std::string& name) const;
  // Its own, or one that is shared with it.
  Level OfCaseAlone(const std::string& principal, const std::string& name) const;
  Level OfExport(const Caller& caller, const std::string& name) const;
  bool IsExported(const std::string& prediction) const;
  Level OfMesh(const Caller& caller, const std::string& name) const;
  void DropShares(const std::string& owner, const std::string& resource);
};

}  // namespace tissueform::testing
