// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/bridge_commands.h"

#include <algorithm>
#include <csignal>
#include <memory>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/string_view.h"

#include "client/pacs_bridge/bridge_parts.h"
#include "client/pacs_bridge/bridge_run.h"
#include "client/pacs_bridge/queue/export_rows.h"
#include "client/pacs_bridge/review/shown_text.h"
#include "client/pacs_bridge/status_text.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

// More than the steps that anything has.
constexpr int kMaxSteps = 16;

// Ctrl-C ends a command at once: each of its steps may be repeated, and its children end with it.
void UnblockEndingSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  pthread_sigmask(SIG_UNBLOCK, &signals, nullptr);
}

PlanWork PlanWorkOf(BridgeParts* parts, const BridgeOptions& options) {
  PlanWorkOptions work = options.plan;
  work.on_progress = [](const std::string& series, absl::string_view stage, double fraction) {
    absl::FPrintF(stderr, "%s %3.0f %% %s\n", series, 100 * fraction, stage);
  };
  return PlanWork(&parts->queue(), parts->server(), std::move(work));
}

void PrintPatient(const QueuedStudy& study, const QueuedExport& queued) {
  absl::PrintF(
      "%s will be stored in the study of\n  name        %s\n  born        %s\n  patient ID  %s\n"
      "  study of    %s\n",
      queued.name, ShownName(study.patient.name), ShownDate(study.patient.birth_date),
      study.patient.id, ShownDate(study.date));
  if (!study.patient.readable) {
    absl::PrintF(
        "  a text of this patient could not be decoded: compare with the PACS before you "
        "store\n");
  }
  if (!queued.note.empty()) absl::PrintF("  note        %s\n", queued.note);
}

// Works until the server knows that it is stored. Permanent failures are reported to it, too.
absl::Status StepToTheEnd(ExportWork* work, QueuedExport* queued) {
  for (int step = 0; step < kMaxSteps && queued->state != BridgeExportState::kReported; ++step) {
    const absl::Status status = work->Step(queued);
    if (queued->state == BridgeExportState::kFailed) {
      if (queued->done_s == 0) work->Step(queued).IgnoreError();
      return absl::FailedPreconditionError(absl::StrCat(queued->name, " has failed: ", queued->note,
                                                        "; request it again in the planner"));
    }
    TF_RETURN_IF_ERROR(status);
    if (queued->state == BridgeExportState::kAsked) {
      return absl::AbortedError(absl::StrCat(queued->note, "; check the patient again"));
    }
  }
  return absl::OkStatus();
}

}  // namespace

BridgeCommands::BridgeCommands(CLI::App& app, const BridgeOptions* options) : options_(options) {
  app.fallthrough();
  app.require_subcommand(0, 1);
  run_ = app.add_subcommand("run", "receive, build, publish and store, by rules, until SIGTERM");
  listen_ = app.add_subcommand("listen", "receive only, until SIGTERM");
  fetch_ = app.add_subcommand("fetch", "request the series of a study from the PACS");
  CLI::Option* const study = fetch_->add_option("STUDY", name_, "its StudyInstanceUID");
  fetch_
      ->add_option("--accession", accession_,
                   "its accession number instead; the PACS may have several studies")
      ->type_name("NUMBER")
      ->excludes(study);
  series_ = app.add_subcommand("series", "received series, and why each was chosen or not");
  build_ =
      app.add_subcommand("build", "build and pack the plan of a series, regardless of the rules");
  build_->add_option("SERIES", name_, "its key, as `series` shows it")->required();
  draft_ = app.add_subcommand("draft",
                              "send the CT of a series to the server, for planning in the browser");
  draft_->add_option("SERIES", name_, "its key, as `series` shows it")->required();
  publish_ = app.add_subcommand("publish", "publish the case of a series to the server");
  publish_->add_option("SERIES", name_, "its key, as `series` shows it")->required();
  store_ =
      app.add_subcommand("store", "show the patient of a prediction, and store it in the PACS");
  store_->add_option("EXPORT", name_, "exports/ID, as `status` shows it")->required();
  store_->add_flag("--confirm-patient", confirmed_,
                   "store it: you have compared the patient shown");
  status_ = app.add_subcommand("status", "status of the queue, without patient data");
  status_->add_flag("--json", json_, "as JSON");
}

int BridgeCommands::Run() const {
  if (run_->parsed()) return RunBridge(*options_, BridgeRunKind::kEverything);
  if (listen_->parsed()) return RunBridge(*options_, BridgeRunKind::kReceiving);
  UnblockEndingSignals();
  const std::vector<std::pair<const CLI::App*, absl::Status (BridgeCommands::*)() const>> steps = {
      {fetch_, &BridgeCommands::Fetch},     {series_, &BridgeCommands::Series},
      {build_, &BridgeCommands::Build},     {draft_, &BridgeCommands::Draft},
      {publish_, &BridgeCommands::Publish}, {store_, &BridgeCommands::Store},
      {status_, &BridgeCommands::Status}};
  for (const auto& [command, step] : steps) {
    if (!command->parsed()) continue;
    const absl::Status status = (this->*step)();
    if (status.ok()) return 0;
    absl::FPrintF(stderr, "tissueform-pacs: %s\n", status.message());
    return 1;
  }
  absl::FPrintF(stderr,
                "tissueform-pacs: name a command: run, listen, fetch, series, build, "
                "draft, publish, store or status; see --help\n");
  return 2;
}

absl::Status BridgeCommands::Fetch() const {
  if (name_.empty() && accession_.empty()) {
    return absl::InvalidArgumentError("name a study by its UID, or --accession NUMBER");
  }
  if (!options_->has_pacs()) {
    return absl::FailedPreconditionError("name the PACS: --pacs HOST:PORT or --pacs-url URL");
  }
  BridgeOptions options = *options_;
  options.quiet = std::chrono::seconds(0);  // when it returns everything has come
  TF_ASSIGN_OR_RETURN(const auto parts, BridgeParts::Open(options));
  std::unique_ptr<StorageReceiver> receiver;
  if (options.pacs.url.empty() && options.pacs.fetch == PacsPeer::Fetch::kMove) {
    TF_ASSIGN_OR_RETURN(receiver, StorageReceiver::Start(ReceiverOptionsOf(options),
                                                         &parts->folder(), &parts->sink()));
  }
  TF_ASSIGN_OR_RETURN(
      const std::vector<SeriesSummary> study,
      parts->pacs()->FindSeries({.study_uid = name_, .accession_number = accession_}));
  int failed = 0;
  for (const SeriesSummary& series : study) {
    TF_ASSIGN_OR_RETURN(const FetchCounts counts,
                        parts->pacs()->FetchSeries(series.study_uid, series.series_uid,
                                                   &parts->folder(), &parts->sink()));
    // One that cannot read an object may end as if it had sent all (Orthanc 1.10).
    const int failed_here = std::max(counts.failed, series.instances - counts.completed);
    absl::PrintF("series %d: %d objects, %d failed\n", series.number, counts.completed,
                 failed_here);
    failed += failed_here;
  }
  // One is chosen of all that have come.
  TF_RETURN_IF_ERROR(parts->intake().Settle().status());
  TF_ASSIGN_OR_RETURN(const std::string table, StatusTable(&parts->queue()));
  absl::PrintF("\n%s", table);
  if (failed == 0) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat(failed,
                   " objects of the study did not arrive; check the PACS's log and "
                   "the local disk, and fetch it again"));
}

absl::Status BridgeCommands::Series() const {
  TF_ASSIGN_OR_RETURN(const std::string folder, StateFolderOf(*options_));
  TF_ASSIGN_OR_RETURN(const auto queue, BridgeQueue::OpenForReading(folder));
  SeriesIntake intake(queue.get(), {});
  TF_ASSIGN_OR_RETURN(const std::string table, SeriesTable(queue.get(), &intake));
  absl::PrintF("%s", table);
  return absl::OkStatus();
}

absl::Status BridgeCommands::Build() const {
  TF_ASSIGN_OR_RETURN(const auto parts, BridgeParts::Open(*options_));
  ReceivedRows rows(&parts->queue());
  TF_ASSIGN_OR_RETURN(QueuedSeries series, rows.Get(name_));
  const std::string recipe = options_->recipe.empty() ? series.recipe : options_->recipe;
  // A chosen series goes on; all others begin again, also one with a finished plan, since the
  // recipe may have changed.
  if (series.state != SeriesState::kChosen || series.recipe != recipe) {
    TF_RETURN_IF_ERROR(parts->intake().Choose(series, recipe, "chosen manually"));
    TF_ASSIGN_OR_RETURN(series, rows.Get(name_));
  }
  PlanWork work = PlanWorkOf(parts.get(), *options_);
  while (series.state == SeriesState::kChosen || series.state == SeriesState::kBuilt) {
    TF_RETURN_IF_ERROR(work.Step(&series));
  }
  absl::PrintF("%s is %s: %s\n", series.key, SeriesStateName(series.state), series.case_name);
  return absl::OkStatus();
}

absl::Status BridgeCommands::Draft() const {
  TF_ASSIGN_OR_RETURN(const auto parts, BridgeParts::Open(*options_));
  ReceivedRows rows(&parts->queue());
  TF_ASSIGN_OR_RETURN(QueuedSeries series, rows.Get(name_));
  const std::string recipe = options_->recipe.empty() ? series.recipe : options_->recipe;
  TF_RETURN_IF_ERROR(
      parts->intake().Choose(series, recipe, "chosen manually", SeriesState::kDrafting));
  TF_ASSIGN_OR_RETURN(series, rows.Get(name_));
  PlanWork work = PlanWorkOf(parts.get(), *options_);
  TF_RETURN_IF_ERROR(work.Step(&series));
  absl::PrintF("%s is %s: open \"%s\" in the planner\n", series.key, SeriesStateName(series.state),
               TitleOfSeries(series.key));
  return absl::OkStatus();
}

absl::Status BridgeCommands::Publish() const {
  TF_ASSIGN_OR_RETURN(const auto parts, BridgeParts::Open(*options_));
  TF_ASSIGN_OR_RETURN(QueuedSeries series, ReceivedRows(&parts->queue()).Get(name_));
  if (series.state == SeriesState::kPacked) {
    PlanWork work = PlanWorkOf(parts.get(), *options_);
    TF_RETURN_IF_ERROR(work.Step(&series));
  }
  if (series.state != SeriesState::kPublished) {
    return absl::FailedPreconditionError(absl::StrCat(
        "series ", series.key, " is ", SeriesStateName(series.state), ": build its case first"));
  }
  absl::PrintF("%s is %s: %s\n", series.key, SeriesStateName(series.state), series.case_name);
  return absl::OkStatus();
}

absl::Status BridgeCommands::Store() const {
  TF_ASSIGN_OR_RETURN(const auto parts, BridgeParts::Open(*options_));
  const std::unique_ptr<ExportWork> work = parts->MakeExportWork();
  if (work == nullptr) {
    return absl::FailedPreconditionError(
        "storing needs a server and a PACS; give --server and "
        "--pacs or --pacs-url");
  }
  ExportRows exports(&parts->queue());
  ReceivedRows received(&parts->queue());
  absl::StatusOr<QueuedExport> found = exports.Get(name_);
  if (absl::IsNotFound(found.status())) {
    TF_ASSIGN_OR_RETURN(const v1::Export requested, parts->server()->GetExport(name_));
    TF_RETURN_IF_ERROR(work->Take(requested));
    found = exports.Get(name_);
  }
  TF_RETURN_IF_ERROR(found.status());
  QueuedExport queued = *found;
  TF_ASSIGN_OR_RETURN(const QueuedSeries series, received.GetByCase(queued.case_name));
  TF_ASSIGN_OR_RETURN(const QueuedStudy study, received.GetStudy(series.study_uid));
  PrintPatient(study, queued);
  if (queued.state == BridgeExportState::kAsked) {
    if (!confirmed_) {
      absl::PrintF("compare the patient, then store it with --confirm-patient\n");
      return absl::OkStatus();
    }
    TF_RETURN_IF_ERROR(exports.Confirm(name_, DigestOf(study.patient)));
    TF_ASSIGN_OR_RETURN(queued, exports.Get(name_));
  }
  TF_RETURN_IF_ERROR(StepToTheEnd(work.get(), &queued));
  absl::PrintF("%s is %s\n", queued.name, BridgeExportStateName(queued.state));
  return absl::OkStatus();
}

absl::Status BridgeCommands::Status() const {
  TF_ASSIGN_OR_RETURN(const std::string folder, StateFolderOf(*options_));
  TF_ASSIGN_OR_RETURN(const auto queue, BridgeQueue::OpenForReading(folder));
  TF_ASSIGN_OR_RETURN(const std::string text,
                      json_ ? StatusJson(queue.get()) : StatusTable(queue.get()));
  absl::PrintF("%s", text);
  return absl::OkStatus();
}

}  // namespace tissueform
