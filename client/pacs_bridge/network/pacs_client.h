// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"

#include "client/pacs_bridge/network/instance_folder.h"
#include "client/pacs_bridge/network/instance_sink.h"
#include "client/pacs_bridge/network/tls_layer.h"

namespace tissueform {

// A PACS that is asked, fetched from and stored to.
struct PacsPeer {
  enum class Kind { kDimse, kDicomWeb };
  enum class Fetch { kGet, kMove };

  std::string name = {};  // for messages
  Kind kind = Kind::kDimse;

  // DIMSE
  std::string host = {};
  int port = 0;
  std::string ae_title = {};                // the peer's
  std::string own_ae_title = "TISSUEFORM";  // ours; where C-MOVE sends to
  Fetch fetch = Fetch::kGet;

  // DICOMweb: "https://pacs.example/dicom-web"; http on this machine alone.
  std::string url = {};

  std::optional<TlsFiles> tls = {};  // of DICOMweb: authorities, and a client's identity if named
  std::chrono::seconds connect_time{10};
  std::chrono::seconds answer_time{60};  // the longest silence
};

struct SeriesQuery {  // one of them
  std::string study_uid = {};
  std::string accession_number = {};
};

// One series as the PACS reports it; empty where it says nothing. Texts are UTF-8.
struct SeriesSummary {
  std::string study_uid = {};
  std::string series_uid = {};
  std::string modality = {};
  std::string description = {};
  std::string study_date = {};
  std::string patient_id = {};
  int number = 0;
  int instances = 0;  // 0: not reported
};

// Whose a study is, as the PACS reports it. Texts are UTF-8.
struct PatientSummary {
  std::string name = {};
  std::string id = {};
  std::string issuer = {};      // of the ID; empty: not reported, or none
  std::string birth_date = {};  // YYYYMMDD; empty: not reported, or none
  bool readable = true;         // false: in a character set that is not known
};

struct FetchCounts {
  int completed = 0;
  int failed = 0;
};

struct StoredObject {
  std::string path = {};
  std::string instance_uid = {};
  absl::Status status = {};  // whether the PACS has it
};

// Threads: one call at a time. Every call is a connection of its own.
//
// Errors of all, one line each with the peer's name and what to do, without patient data:
// Unavailable (it does not answer, or breaks off: try again), PermissionDenied (it refuses us),
// DeadlineExceeded (silence), Unimplemented (it offers no such service), FailedPrecondition (it
// refuses what is asked, with a status), Unauthenticated (TLS fails), InvalidArgument (an argument;
// an answer that cannot be understood: Internal).
class PacsClient {
 public:
  virtual ~PacsClient() = default;

  // All series of a study, or of all with an accession number. Errors: also NotFound.
  virtual absl::StatusOr<std::vector<SeriesSummary>> FindSeries(const SeriesQuery& query) = 0;

  // Whose a study is now. Errors: also NotFound.
  virtual absl::StatusOr<PatientSummary> FindPatient(const std::string& study_uid) = 0;

  // Lets the objects of a series come: into the folder and to the sink, or, by C-MOVE, to the
  // receiver that the peer knows by own_ae_title. Returns when all have come or failed.
  virtual absl::StatusOr<FetchCounts> FetchSeries(const std::string& study_uid,
                                                  const std::string& series_uid,
                                                  InstanceFolder* folder, InstanceSink* sink) = 0;

  // The header of one object of a series, of a CT image where the PACS names one, without
  // pixels, as a new file (0600). Errors: also NotFound.
  virtual absl::Status FetchHeader(const std::string& study_uid, const std::string& series_uid,
                                   const std::string& path) = 0;

  // Whether it has this object: asked before something is sent again.
  virtual absl::StatusOr<bool> Has(const std::string& study_uid, const std::string& series_uid,
                                   const std::string& instance_uid) = 0;

  // Sends files. An error: none was sent; otherwise what became of each, in their order.
  virtual absl::StatusOr<std::vector<StoredObject>> Store(absl::Span<const std::string> paths) = 0;
};

// Errors: InvalidArgument (what the peer lacks), those of MakeTlsLayer.
absl::StatusOr<std::unique_ptr<PacsClient>> MakePacsClient(const PacsPeer& peer);

}  // namespace tissueform
