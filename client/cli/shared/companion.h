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
    "demo", "drag the mandible of the bundled head through a server, end to end",
    "tissueform-online"};
inline constexpr CompanionCommand kLoadCommand = {
    "load", "drag many sessions of a server at once and report the age of the frames",
    "tissueform-load", true};
inline constexpr CompanionCommand kBenchCommand = {
    "bench", "benchmark against other libraries on this machine", "tissueform-benchmarks", true};
inline constexpr CompanionCommand kDragCommand = {
    "drag", "drag on a server, back and forth; continues after a restart of the server",
    "tissueform-online"};
inline constexpr CompanionCommand kSessionCommand = {
    "session", "list, show, update, link and delete the sessions of a server", "tissueform-online"};
// Of `plan`.
inline constexpr CompanionCommand kServerBuildCommand = {"build", "build a plan on a server",
                                                         "tissueform-online"};
// Of `mesh`.
inline constexpr CompanionCommand kMeshUploadCommand = {
    "upload", "upload a mesh to a server and print its name", "tissueform-online"};
inline constexpr CompanionCommand kMeshListCommand = {"list", "list the meshes of a server",
                                                      "tissueform-online"};
inline constexpr CompanionCommand kMeshDeleteCommand = {
    "delete", "delete a mesh without sessions from a server", "tissueform-online"};
inline constexpr CompanionCommand kWatchCommand = {"watch", "watch a drag, one line per second",
                                                   "tissueform-online"};
inline constexpr CompanionCommand kPredictionCommand = {
    "prediction",
    "create, list, compare, export and delete stored predictions, or send them to the PACS",
    "tissueform-online"};
inline constexpr CompanionCommand kCaseCommand = {"case", "cases: what the browser planner opens",
                                                  "tissueform-online"};
inline constexpr CompanionCommand kExportCommand = {
    "export", "create a moving file: one web page that works without a server",
    "tissueform-online"};
inline constexpr CompanionCommand kOutcomeCommand = {
    "outcome", "compare predictions with the face after the operation", "tissueform-outcome"};
inline constexpr CompanionCommand kShareCommand = {"share", "share your resources on a server",
                                                   "tissueform-online"};
inline constexpr CompanionCommand kWhoamiCommand = {"whoami", "show your identity on a server",
                                                    "tissueform-online"};
inline constexpr CompanionCommand kServerInfoCommand = {
    "server-info", "show a server's version, models and limits", "tissueform-online"};
inline constexpr CompanionCommand kDoctorCommand = {
    "doctor", "diagnose the connection to a server, from its name to a drag", "tissueform-online"};
inline constexpr CompanionCommand kLoginCommand = {
    "login", "log in at an identity provider and store the token", "tissueform-online"};
inline constexpr CompanionCommand kLogoutCommand = {"logout", "remove the stored token",
                                                    "tissueform-online"};
inline constexpr CompanionCommand kExperimentsCommand = {
    "experiments", "reproduce the paper's figures and table, and measure the models' accuracy",
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
