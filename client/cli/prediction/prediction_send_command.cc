// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/prediction/prediction_send_command.h"

#include <memory>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "client/cli/session/resource_text.h"
#include "client/cli/session/server_connection.h"
#include "client/cpp/tissueform_client.h"
#include "core/base/status_macros.h"
#include "proto/conversion/export_conversion.h"

namespace tissueform {
namespace {

struct SendOptions {
  ServerConnection server;
  std::string name;
  std::string prediction;
  std::string case_name;
  bool wait = false;
};

void PrintState(const v1::Export& sent) {
  absl::PrintF("%s: %s%s%s, %d objects in the PACS\n", sent.name(), ExportStateText(sent.state()),
               sent.detail().empty() ? "" : ": ", sent.detail(), sent.stored_objects());
}

bool IsOver(const v1::Export& sent) {
  return sent.state() == v1::EXPORT_STATE_STORED || sent.state() == v1::EXPORT_STATE_FAILED;
}

// Until it is done, with a line for every change.
absl::Status WaitForEnd(ExportCalls* calls, const std::string& name) {
  const std::unique_ptr<ExportWatchStream> watch = calls->Watch();
  bool received_all = false;
  while (const auto response = watch->Receive()) {
    v1::Export sent = response->export_();
    if (!response->has_export_() && !received_all) {
      received_all = true;
      TF_ASSIGN_OR_RETURN(sent, calls->Get(name));  // it may have been done before the watch
      if (!IsOver(sent)) continue;
    }
    if (sent.name() != name) continue;
    PrintState(sent);
    if (sent.state() == v1::EXPORT_STATE_FAILED) {
      return absl::FailedPreconditionError(absl::StrCat(name, " has failed: ", sent.detail()));
    }
    if (IsOver(sent)) return absl::OkStatus();
  }
  return watch->Finish();
}

absl::Status Send(const SendOptions& options) {
  TF_ASSIGN_OR_RETURN(const auto client, ConnectTo(options.server));
  TF_ASSIGN_OR_RETURN(const v1::Export sent,
                      client->exports().Create(FullName("predictions", options.name)));
  PrintState(sent);
  if (!options.wait) return absl::OkStatus();
  return WaitForEnd(&client->exports(), sent.name());
}

absl::Status ListSent(const SendOptions& options) {
  TF_ASSIGN_OR_RETURN(const auto client, ConnectTo(options.server));
  const auto full = [](const std::string& collection, const std::string& name) {
    return name.empty() ? "" : FullName(collection, name);
  };
  TF_ASSIGN_OR_RETURN(const auto all,
                      client->exports().List(full("predictions", options.prediction),
                                             full("cases", options.case_name)));
  absl::PrintF("%-53s %-46s %-22s %7s %-20s %s\n", "export", "prediction", "state", "objects",
               "changed", "detail");
  for (const v1::Export& sent : all) {
    absl::PrintF("%-53s %-46s %-22s %7d %-20s %s\n", sent.name(), sent.prediction(),
                 ExportStateText(sent.state()), sent.stored_objects(), TimeText(sent.update_time()),
                 sent.detail());
  }
  absl::PrintF("%d exports\n", all.size());
  return absl::OkStatus();
}

absl::Status Unsend(const SendOptions& options) {
  TF_ASSIGN_OR_RETURN(const auto client, ConnectTo(options.server));
  const std::string name = FullName("exports", options.name);
  TF_RETURN_IF_ERROR(client->exports().Delete(name));
  absl::PrintF("withdrew %s; objects already in the PACS remain there\n", name);
  return absl::OkStatus();
}

}  // namespace

void AddPredictionSendCommands(CLI::App& prediction, CommandWork* work) {
  auto options = std::make_shared<SendOptions>();
  const auto add = [&](const char* name, const char* what,
                       absl::Status (*run)(const SendOptions&)) {
    CLI::App* sub = prediction.add_subcommand(name, what);
    AddServerOption(sub, &options->server);
    sub->callback([options, work, run] { *work = [options, run] { return run(*options); }; });
    return sub;
  };
  CLI::App* send = add("send", "request storage of a prediction in the patient's study", Send);
  send->add_option("PREDICTION", options->name, "prediction name, with or without \"predictions/\"")
      ->required();
  send->add_flag("--wait", options->wait, "wait until it is stored or fails");
  CLI::App* sent = add("sent", "list exports to the PACS", ListSent);
  sent->add_option("--prediction", options->prediction, "of this prediction only");
  sent->add_option("--case", options->case_name, "of this case only");
  add("unsend", "withdraw an export", Unsend)
      ->add_option("EXPORT", options->name, "export name, with or without \"exports/\"")
      ->required();
}

}  // namespace tissueform
