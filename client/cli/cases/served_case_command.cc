// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/cases/served_case_command.h"

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "client/cli/cases/packed_case.h"
#include "client/cli/session/resource_text.h"
#include "client/cli/session/server_connection.h"
#include "client/cpp/tissueform_client.h"
#include "core/base/status_macros.h"
#include "core/planning/case_file/case_reader.h"

namespace tissueform {
namespace {

struct ServedCaseOptions {
  ServerConnection server;
  std::string file;
  std::string name;
  std::string title;

  std::string FullCase() const { return FullName("cases", name); }
};

// The file as it is: a case is named by its bytes.
absl::StatusOr<std::string> ReadCaseBytes(const std::string& path) {
  std::error_code error;
  const uintmax_t size = std::filesystem::file_size(path, error);
  if (error) {
    return absl::NotFoundError(absl::StrCat("cannot read ", path, ": ", error.message()));
  }
  if (size > kMaxCaseBytes) {
    return absl::ResourceExhaustedError(
        absl::StrCat(path, " has ", size, " bytes; a case may have ", kMaxCaseBytes));
  }
  std::string bytes(size, '\0');
  std::ifstream stream(path, std::ios::binary);
  stream.read(bytes.data(), static_cast<std::streamsize>(size));
  if (!stream) return absl::UnavailableError(absl::StrCat("cannot read all of ", path));
  return bytes;
}

void PrintCaseHead() { absl::PrintF("%-70s %10s %-20s %s\n", "case", "MB", "sent", "title"); }

void PrintCase(const v1::Case& found) {
  absl::PrintF("%-70s %10.1f %-20s %s\n", found.name(),
               1e-6 * static_cast<double>(found.total_bytes()), TimeText(found.create_time()),
               found.title());
}

absl::Status Publish(const ServedCaseOptions& options) {
  TF_ASSIGN_OR_RETURN(const std::string bytes, ReadCaseBytes(options.file));
  absl::StatusOr<CaseFile> contents = ParseCase(bytes);
  if (!contents.ok()) {
    return absl::Status(contents.status().code(),
                        absl::StrCat(options.file, ": ", contents.status().message(),
                                     "; `tissueform case pack` makes cases"));
  }
  TF_ASSIGN_OR_RETURN(const auto client, ConnectTo(options.server));
  const std::string& title = options.title.empty() ? contents->title : options.title;
  TF_ASSIGN_OR_RETURN(const v1::Case published, PublishCase(client.get(), *contents, bytes, title));
  PrintCaseHead();
  PrintCase(published);
  return absl::OkStatus();
}

absl::Status List(const ServedCaseOptions& options) {
  TF_ASSIGN_OR_RETURN(const auto client, ConnectTo(options.server));
  TF_ASSIGN_OR_RETURN(const std::vector<v1::Case> cases, client->cases().List());
  PrintCaseHead();
  for (const v1::Case& found : cases) PrintCase(found);
  absl::PrintF("%d cases\n", cases.size());
  return absl::OkStatus();
}

absl::Status Show(const ServedCaseOptions& options) {
  TF_ASSIGN_OR_RETURN(const auto client, ConnectTo(options.server));
  TF_ASSIGN_OR_RETURN(const v1::Case found, client->cases().Get(options.FullCase()));
  absl::PrintF("case    %s\ntitle   %s\nbytes   %d\nsent    %s\n", found.name(), found.title(),
               found.total_bytes(), TimeText(found.create_time()));
  return absl::OkStatus();
}

absl::Status Delete(const ServedCaseOptions& options) {
  TF_ASSIGN_OR_RETURN(const auto client, ConnectTo(options.server));
  TF_RETURN_IF_ERROR(client->cases().Delete(options.FullCase()));
  absl::PrintF("%s is deleted\n", options.FullCase());
  return absl::OkStatus();
}

constexpr char kPublishFooter[] =
    "The server keeps the file as it is, under the SHA-256 of its bytes, and gives it to planners; "
    "it is also\ngiven the mesh in it, so that a planner that opens the case need not send it.\n\n"
    "It shows the patient's face: treat it like the CT. Title and face are seen by all who reach "
    "the server.\n\n"
    "Example:\n"
    "  tissueform case publish head.tfcase --title \"Lower jaw forward\" --server localhost:50051\n"
    "Exit codes: 0 done, 1 the work failed, 2 wrong use.";

}  // namespace

void AddServedCaseCommands(CLI::App& command, CommandWork* work) {
  auto options = std::make_shared<ServedCaseOptions>();
  const auto add = [&](const char* name, const char* what,
                       absl::Status (*run)(const ServedCaseOptions&)) {
    CLI::App* sub = command.add_subcommand(name, what);
    AddServerOption(sub, &options->server);
    sub->callback([options, work, run] { *work = [options, run] { return run(*options); }; });
    return sub;
  };
  const auto add_name = [&](CLI::App* sub) {
    sub->add_option("CASE", options->name, "its name, with \"cases/\" or without")->required();
  };
  CLI::App* publish = add("publish", "give a case to a server, for planners to open", Publish);
  publish->add_option("FILE", options->file, "the case, NAME.tfcase (docs/case-format.md)")
      ->required();
  publish->add_option("--title", options->title,
                      "what lists call it; left out: the title in the file");
  publish->footer(kPublishFooter);
  add("list", "the cases of a server", List);
  add_name(add("show", "what a server knows of a case", Show));
  add_name(add("delete", "delete a case of a server; sessions and predictions stay", Delete));
}

}  // namespace tissueform
