// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"

#include "client/pacs_bridge/network/pacs_client.h"
#include "client/pacs_bridge/queue/export_rows.h"
#include "client/pacs_bridge/queue/received_rows.h"
#include "client/pacs_bridge/work/case_server.h"
#include "client/pacs_bridge/work/export_pictures.h"
#include "client/pacs_bridge/work/object_writer.h"
#include "client/pacs_bridge/work/patient_header.h"

namespace tissueform {

struct ExportWorkOptions {
  // How long a kept header stands for the PACS's own where the PACS returns no headers.
  std::chrono::seconds header_lifetime = std::chrono::hours(24) * 90;
  // Receives one line about what is left out although nothing stops for it. The line names no
  // patient. May be empty.
  std::function<void(const std::string& line)> warn = {};
  // The same of what is nothing to worry about.
  std::function<void(const std::string& line)> inform = {};
};

// From a surgeon's request to objects in the patient's study, one durable step after the other:
//
//   asked      waits for a person (ExportRows::Confirm), who has seen the patient
//   confirmed  fetches the patient's header; if that names another patient than the person has
//              seen, goes back to asked, with a note
//   fetched    puts UIDs into the queue, then writes the objects
//   written    asks the PACS for each, and sends those that it has not
//   sent       reports to the server
//   told       (kReported) the server knows
//
// Every step may be repeated: an object keeps its UID, so the PACS gets each once. One thread at a
// time for Take and Step, and beside it one for Draw. What it is given must outlive it.
class ExportWork {
 public:
  ExportWork(BridgeQueue* queue, CaseServer* server, PacsClient* pacs, ObjectWriter* writer,
             const ExportWorkOptions& options)
      : queue_(queue),
        rows_(queue),
        received_(queue),
        server_(server),
        pacs_(pacs),
        writer_(writer),
        options_(options),
        pictures_(server, writer, options.warn) {}

  // Takes what the server reports of an export into the queue. A case that is unknown here belongs
  // to another bridge: nothing happens but a line that says so. Errors: those of the queue and,
  // while drafts wait, of the server.
  absl::Status Take(const v1::Export& reported);

  // Draws the pictures of a requested export for the person who confirms it, and asks for its band;
  // does nothing if they exist. Step waits for it where it needs them. `queued.attempts` says how
  // often it was tried. Errors: those of the server and of drawing; confirming is still possible.
  absl::Status Draw(const QueuedExport& queued);

  // Whether the server still has an export that waits for a person. One that was taken back, has
  // expired there or is done leaves the queue, with all that was made for it. Errors: those of the
  // server and of the queue.
  absl::StatusOr<bool> IsStillAsked(const QueuedExport& queued);

  // The next step of an export, whose new state is written to the queue and into it. An error that
  // is no transient one makes it kFailed. Also reports to the server one that waits or has failed.
  //
  // Errors: those of the step; they hold nothing of a patient.
  absl::Status Step(QueuedExport* queued);

 private:
  // Errors: NotFound: of none of this bridge; those of the server.
  absl::StatusOr<QueuedSeries> SeriesOfCase(const std::string& case_name);
  absl::Status RunStep(QueuedExport* queued);
  absl::Status Fetch(QueuedExport* queued);
  // Back to the person: the PACS now names another patient than the one that was confirmed.
  absl::Status AskAnew(QueuedExport* queued, const std::string& study_uid, const FoundPatient& now);
  absl::StatusOr<ExportMaterial> Gather(const QueuedExport& queued);
  absl::Status Write(QueuedExport* queued);
  absl::Status Send(QueuedExport* queued);
  absl::Status SendMissing(const QueuedExport& queued, std::vector<QueuedObject>* objects);
  absl::Status ReportStored(QueuedExport* queued);
  absl::Status ReportFailed(QueuedExport* queued);

  BridgeQueue* const queue_;
  ExportRows rows_;
  ReceivedRows received_;
  CaseServer* const server_;
  PacsClient* const pacs_;
  ObjectWriter* const writer_;
  const ExportWorkOptions options_;
  ExportPictures pictures_;
};

}  // namespace tissueform
