// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "client/cli/shared/command_line.h"

namespace tissueform {

// A command whose work another program does, which lies where FindProgram looks: loading the
// libraries that only few commands need (gRPC, VTK's rendering) takes longer than most predictions.
struct CompanionCommand {
  const char* name;
  const char* description;
  const char* program;  // tissueform-NAME
  bool is_lab = false;  // of client/lab, which packages leave out
};

inline constexpr CompanionCommand kRunCommand = {"run", "predict through a tissueform-server",
                                                 "tissueform-online"};
inline constexpr CompanionCommand kDemoCommand = {
    "demo", "drag the lower jaw of the bundled real head through a server, end to end",
    "tissueform-online"};
inline constexpr CompanionCommand kLoadCommand = {
    "load", "drag many sessions of a server at once and report the age of the frames",
    "tissueform-load", true};
inline constexpr CompanionCommand kBenchCommand = {
    "bench", "measure on this machine against the libraries one would use instead",
    "tissueform-benchmarks", true};
inline constexpr CompanionCommand kDragCommand = {
    "drag", "drag on a server, to and fro; goes on when the server is started again",
    "tissueform-online"};
inline constexpr CompanionCommand kSessionCommand = {
    "session", "list, show, update, link and delete the sessions of a server", "tissueform-online"};
// Of `mesh`.
inline constexpr CompanionCommand kMeshUploadCommand = {
    "upload", "give a mesh of tets to a server, which tells its name", "tissueform-online"};
inline constexpr CompanionCommand kMeshListCommand = {"list", "the meshes that a server has",
                                                      "tissueform-online"};
inline constexpr CompanionCommand kMeshDeleteCommand = {
    "delete", "delete a mesh of a server from which no session is made", "tissueform-online"};
inline constexpr CompanionCommand kWatchCommand = {
    "watch", "follow a session that somebody drags, a line a second", "tissueform-online"};
inline constexpr CompanionCommand kPredictionCommand = {
    "prediction", "make, list, compare, export, delete and send to the PACS what a server keeps",
    "tissueform-online"};
inline constexpr CompanionCommand kCaseCommand = {"case", "cases: what the browser planner opens",
                                                  "tissueform-online"};
inline constexpr CompanionCommand kExportCommand = {
    "export", "make a file in which a face moves: one page that opens without a server",
    "tissueform-online"};
inline constexpr CompanionCommand kShareCommand = {
    "share", "let others look at one's own on a server, or drag it", "tissueform-online"};
inline constexpr CompanionCommand kWhoamiCommand = {"whoami", "tell whom a server takes one for",
                                                    "tissueform-online"};
inline constexpr CompanionCommand kServerInfoCommand = {
    "server-info", "tell what a server is: version, models, limits", "tissueform-online"};
inline constexpr CompanionCommand kDoctorCommand = {
    "doctor", "tell why a server cannot be used from here, from its name to a drag",
    "tissueform-online"};
inline constexpr CompanionCommand kLoginCommand = {
    "login", "log in at an identity provider: the token that servers ask for", "tissueform-online"};
inline constexpr CompanionCommand kLogoutCommand = {
    "logout", "remove the token that `login` has left", "tissueform-online"};
inline constexpr CompanionCommand kExperimentsCommand = {
    "experiments", "compute the paper's figures and table again, and the models' accuracy",
    "tissueform-experiments", true};

// Adds the command to `app`; all that follows its name, --help too, is left to the companion, which
// is given the words of this process's command line. A command of the laboratory whose program is
// not installed is left out of the help, and says so when it is used.
void AddCompanionCommand(CLI::App& app, const CompanionCommand& companion,
                         std::vector<std::string> words, CommandWork* work);

// Becomes the program of that name, where FindProgram finds it, with `arguments`. Returns only when
// it cannot be started: NotFound, or what the system says.
absl::Status BecomeProgram(const std::string& name, std::vector<std::string> arguments);

}  // namespace tissueform
