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
        absl::StrCat(path, " has ", size, " bytes; the limit of a case is ", kMaxCaseBytes));
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
                                     "; create cases with `tissueform case pack`"));
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
  absl::PrintF("deleted %s\n", options.FullCase());
  return absl::OkStatus();
}

constexpr char kPublishFooter[] =
    "The server stores the file under the SHA-256 of its bytes, for planners; "
    "its\nmesh is uploaded too, so that planners need not send it.\n\n"
    "It shows the patient's face: treat it like the CT. Without logins, title and face are visible "
    "to everyone who can reach "
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
    sub->add_option("CASE", options->name, "case name, with or without \"cases/\"")->required();
  };
  CLI::App* publish = add("publish", "publish a case to a server, for planners", Publish);
  publish->add_option("FILE", options->file, "the case, NAME.tfcase (docs/case-format.md)")
      ->required();
  publish->add_option("--title", options->title, "title in lists (default: the file's title)");
  publish->footer(kPublishFooter);
  add("list", "list the cases of a server", List);
  add_name(add("show", "details of a case on a server", Show));
  add_name(add("delete", "delete a case from a server; sessions and predictions stay", Delete));
}

}  // namespace tissueform
