// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/account/audit_command.h"

#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "server/platform/audit_chain/audit_key.h"
#include "server/platform/audit_chain/audit_verification.h"

namespace tissueform {
namespace {

struct VerifyOptions {
  std::vector<std::string> files;
  std::string key;
  std::string checkpoints;  // empty: none
};

void AddKeygen(CLI::App& audit, CommandWork* work) {
  CLI::App* command = audit.add_subcommand("keygen", "create the key of an audit log");
  auto path = std::make_shared<std::string>();
  command->add_option("FILE", *path, "a new file, which gets mode 0600")->required();
  command->callback([path, work] {
    *work = [path] {
      TF_RETURN_IF_ERROR(AuditKey::WriteNew(*path));
      std::cout << "key written to " << *path
                << "; keep a copy out of reach of the server's machine\n";
      return absl::OkStatus();
    };
  });
}

absl::Status Verify(const VerifyOptions& options) {
  TF_ASSIGN_OR_RETURN(const AuditKey key, AuditKey::Read(options.key));
  std::vector<AuditCheckpoint> checkpoints;
  if (!options.checkpoints.empty()) {
    TF_ASSIGN_OR_RETURN(checkpoints, ReadCheckpoints(options.checkpoints));
    if (checkpoints.empty()) {
      return absl::InvalidArgumentError(
          absl::StrCat(options.checkpoints, ": no checkpoint of an audit log"));
    }
  }
  TF_ASSIGN_OR_RETURN(const AuditReport report, VerifyAuditFiles(options.files, key, checkpoints));
  if (report.finding.has_value()) {
    const AuditFinding& finding = *report.finding;
    return absl::DataLossError(absl::StrCat(finding.file, ":", finding.line, ": ",
                                            AuditFaultName(finding.fault), ": ", finding.what));
  }
  std::cout << "ok: " << report.lines << " lines in " << report.files
            << " files, n=" << report.first << " to n=" << report.last.number << "\n";
  if (report.mended > 0) {
    std::cout << "crashes: " << report.mended << " incomplete lines were set aside by the server\n";
  }
  if (report.lost > 0) {
    std::cout << "lost: the server notes " << report.lost
              << " times that lines were lost; look for \"event\":\"lost\"\n";
  }
  if (checkpoints.empty()) {
    std::cout << "without --checkpoints, missing lines cannot be detected after n="
              << report.last.number << "\n";
  } else {
    std::cout << "checkpoints: " << checkpoints.size() << " compared\n";
  }
  return absl::OkStatus();
}

void AddVerify(CLI::App& audit, CommandWork* work) {
  CLI::App* command =
      audit.add_subcommand("verify",
                           "verify the files of an audit log, or report the first changed "
                           "line and how");
  auto options = std::make_shared<VerifyOptions>();
  command->add_option("FILE", options->files, "files of one audit log, in any order")->required();
  command->add_option("--key", options->key, "the key of the server's audit log")
      ->type_name("FILE")
      ->required();
  command
      ->add_option("--checkpoints", options->checkpoints,
                   "file of the system's log with the checkpoints of --audit-syslog")
      ->type_name("FILE");
  command->callback([options, work] { *work = [options] { return Verify(*options); }; });
}

}  // namespace

void AddAuditCommand(CLI::App& app, CommandWork* work) {
  CLI::App* audit = app.add_subcommand("audit", "the audit log of a server");
  audit->require_subcommand(1);
  AddKeygen(*audit, work);
  AddVerify(*audit, work);
}

}  // namespace tissueform
