// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/dicom_web_client.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include <nlohmann/json.hpp>

#include "client/pacs_bridge/dicom/dicom_uid.h"
#include "client/pacs_bridge/network/dicom_web_answers.h"
#include "client/pacs_bridge/network/http_exchange.h"
#include "client/pacs_bridge/network/incoming_instances.h"
#include "client/pacs_bridge/network/one_header.h"
#include "core/base/certificates.h"
#include "core/base/status_macros.h"
#include "core/imaging/series/image_header.h"

namespace tissueform {
namespace {

using Json = nlohmann::json;

constexpr size_t kMaxJsonBytes = 32 << 20;
constexpr int64_t kMaxSentBytes = int64_t{1} << 30;
constexpr int kBadRequest = 400;
// Answers of STOW-RS that say what became of the object.
constexpr std::array<int, 3> kStowAnswers = {200, 202, 409};

class DicomWebClient : public PacsClient {
 public:
  explicit DicomWebClient(PacsPeer peer) : peer_(std::move(peer)) {}

  absl::StatusOr<PatientSummary> FindPatient(const std::string& study_uid) override {
    TF_RETURN_IF_ERROR(CheckDicomUids({study_uid}));
    TF_ASSIGN_OR_RETURN(
        const Json answer,
        Query(absl::StrCat("/studies?StudyInstanceUID=", study_uid, "&includefield=00100021")));
    for (const Json& object : answer) {
      if (JsonValueOf(object, "0020000D") == study_uid) return PatientSummaryFrom(object);
    }
    return Missing("study");
  }

  absl::StatusOr<std::vector<SeriesSummary>> FindSeries(const SeriesQuery& query) override {
    std::vector<std::string> studies = {query.study_uid};
    if (query.study_uid.empty()) {
      TF_ASSIGN_OR_RETURN(studies, FindStudies(query.accession_number));
    }
    std::vector<SeriesSummary> series;
    for (const std::string& study : studies) {
      TF_RETURN_IF_ERROR(CheckDicomUids({study}));
      TF_ASSIGN_OR_RETURN(const Json answer,
                          Query(absl::StrCat("/studies/", study,
                                             "/series?includefield=0008103E&includefield=00080020"
                                             "&includefield=00100020&includefield=00201209")));
      for (const Json& object : answer) {
        series.push_back(SeriesSummaryFrom(object));
        if (series.back().study_uid.empty()) series.back().study_uid = study;
      }
    }
    if (series.empty()) return Missing("study");
    return series;
  }

  absl::StatusOr<FetchCounts> FetchSeries(const std::string& study_uid,
                                          const std::string& series_uid, InstanceFolder* folder,
                                          InstanceSink* sink) override {
    TF_RETURN_IF_ERROR(CheckDicomUids({study_uid, series_uid}));
    return Retrieve(absl::StrCat("/studies/", study_uid, "/series/", series_uid), *folder, sink);
  }

  absl::Status FetchHeader(const std::string& study_uid, const std::string& series_uid,
                           const std::string& path) override {
    TF_RETURN_IF_ERROR(CheckDicomUids({study_uid, series_uid}));
    const std::string instances =
        absl::StrCat("/studies/", study_uid, "/series/", series_uid, "/instances");
    TF_ASSIGN_OR_RETURN(const std::string instance, SourceInstance(instances));
    if (!IsDicomUid(instance)) return Missing("series");
    return KeepOneHeader(path, [&](const InstanceFolder& folder, InstanceSink* sink) {
      return Retrieve(absl::StrCat(instances, "/", instance), folder, sink).status();
    });
  }

  absl::StatusOr<bool> Has(const std::string& study_uid, const std::string& series_uid,
                           const std::string& instance_uid) override {
    TF_RETURN_IF_ERROR(CheckDicomUids({study_uid, series_uid, instance_uid}));
    const auto answer = Query(absl::StrCat("/studies/", study_uid, "/series/", series_uid,
                                           "/instances?SOPInstanceUID=", instance_uid));
    if (absl::IsNotFound(answer.status())) return false;
    if (!answer.ok()) return answer.status();
    for (const Json& object : *answer) {
      if (JsonValueOf(object, "00080018") == instance_uid) return true;
    }
    return false;
  }

  absl::StatusOr<std::vector<StoredObject>> Store(absl::Span<const std::string> paths) override {
    std::vector<StoredObject> stored;
    std::vector<InstanceHeader> headers;
    for (const std::string& path : paths) {
      TF_ASSIGN_OR_RETURN(headers.emplace_back(), ReadInstanceHeader(path));
      stored.push_back({path, headers.back().instance_uid});
    }
    for (size_t i = 0; i < stored.size(); ++i) stored[i].status = StoreOne(paths[i], headers[i]);
    return stored;
  }

 private:
  // A QIDO-RS answer: an array, empty where there is nothing.
  absl::StatusOr<Json> Query(const std::string& path) {
    std::string text;
    TF_ASSIGN_OR_RETURN(
        const HttpAnswer answer,
        Exchange(peer_, {.path = path, .headers = {"Accept: application/dicom+json"}},
                 [&](const std::string& /*type*/, absl::string_view piece) -> absl::Status {
                   if (text.size() + piece.size() > kMaxJsonBytes) {
                     return absl::InternalError(absl::StrCat("the PACS '", peer_.name,
                                                             "' answers a query with more than ",
                                                             kMaxJsonBytes, " bytes"));
                   }
                   text.append(piece.data(), piece.size());
                   return absl::OkStatus();
                 }));
    if (answer.status == 204) return Json::array();
    if (answer.status != 200) return HttpFailed(answer, "a query (QIDO-RS)");
    Json parsed = Json::parse(text, nullptr, false);
    if (!parsed.is_array()) {
      return absl::InternalError(
          absl::StrCat("the PACS '", peer_.name, "' answers a query with no DICOM JSON"));
    }
    return parsed;
  }

  // A CT image if the PACS lists one, otherwise any object; empty if it lists no object.
  absl::StatusOr<std::string> SourceInstance(const std::string& instances) {
    for (const std::string& wanted :
         {absl::StrCat("SOPClassUID=", kCtImageClass, "&"), std::string()}) {
      const auto answer = Query(absl::StrCat(instances, "?", wanted, "limit=1"));
      if (!answer.ok() && wanted.empty()) return answer.status();
      if (answer.ok() && !answer->empty()) return JsonValueOf((*answer)[0], "00080018");
    }
    return "";
  }

  absl::StatusOr<std::vector<std::string>> FindStudies(const std::string& accession_number) {
    // What is not plain would need escapes, and wild cards match other patients.
    for (const char c : accession_number) {
      if (!absl::ascii_isalnum(static_cast<unsigned char>(c)) && c != '-' && c != '.' && c != '_') {
        return absl::InvalidArgumentError(
            "an accession number with other characters than letters, digits, - . _ cannot be "
            "asked for: name the study's UID");
      }
    }
    if (accession_number.empty()) {
      return absl::InvalidArgumentError("name a study's UID or an accession number");
    }
    TF_ASSIGN_OR_RETURN(const Json answer,
                        Query(absl::StrCat("/studies?AccessionNumber=", accession_number)));
    std::vector<std::string> studies;
    for (const Json& object : answer) studies.push_back(JsonValueOf(object, "0020000D"));
    return studies;
  }

  // WADO-RS, every object in the transfer syntax that it has.
  absl::StatusOr<FetchCounts> Retrieve(const std::string& path, const InstanceFolder& folder,
                                       InstanceSink* sink) {
    IncomingInstances objects(peer_.name, folder, sink);
    TF_ASSIGN_OR_RETURN(
        const HttpAnswer answer,
        Exchange(peer_,
                 {.path = path,
                  .headers = {"Accept: multipart/related; type=\"application/dicom\"; "
                              "transfer-syntax=*"}},
                 [&](const std::string& type, absl::string_view piece) {
                   return objects.Take(type, piece);
                 }));
    if (answer.status != 200) return HttpFailed(answer, "a request for objects (WADO-RS)");
    return objects.Finish();
  }

  absl::Status StoreOne(const std::string& path, const InstanceHeader& header) {
    std::error_code error;
    if (std::filesystem::file_size(path, error) > kMaxSentBytes || error) {
      return absl::InvalidArgumentError(absl::StrCat(path, ": too large to be sent"));
    }
    std::ifstream file(path, std::ios::binary);
    const std::string boundary = absl::StrCat("tissueform-", NewDicomUid());
    std::string body = absl::StrCat("--", boundary, "\r\nContent-Type: application/dicom\r\n\r\n");
    body.append(std::istreambuf_iterator<char>(file), {});
    absl::StrAppend(&body, "\r\n--", boundary, "--\r\n");
    std::string text;
    HttpAnswer answer;
    // Both are right (RFC 2046), but some servers know only the one or the other.
    for (const char* quote : {"\"", ""}) {
      TF_ASSIGN_OR_RETURN(answer, PostObject(body, absl::StrCat(quote, boundary, quote), &text));
      if (answer.status != kBadRequest) break;
    }
    if (std::find(kStowAnswers.begin(), kStowAnswers.end(), answer.status) == kStowAnswers.end()) {
      return HttpFailed(answer, "an object (STOW-RS)");
    }
    if (text.empty()) text = std::move(answer.body);
    return Confirmed(StatusOfStow(peer_.name, text, header.instance_uid, answer.status), header);
  }

  absl::StatusOr<HttpAnswer> PostObject(const std::string& body, const std::string& boundary,
                                        std::string* text) {
    return Exchange(peer_,
                    {.path = "/studies",
                     .headers = {absl::StrCat("Content-Type: multipart/related; "
                                              "type=\"application/dicom\"; boundary=",
                                              boundary),
                                 "Accept: application/dicom+json", "Expect:"},
                     .body = &body},
                    [text](const std::string& /*type*/, absl::string_view piece) {
                      if (text->size() < kMaxJsonBytes) text->append(piece.data(), piece.size());
                      return absl::OkStatus();
                    });
  }

  // Answers of STOW-RS differ from PACS to PACS, and our copy is deleted by what they say: so what
  // the PACS finds when it is asked counts, where it answers queries.
  absl::Status Confirmed(const absl::Status& reported, const InstanceHeader& header) {
    const absl::StatusOr<bool> there =
        Has(header.study_uid, header.series_uid, header.instance_uid);
    if (absl::IsUnimplemented(there.status()) || absl::IsFailedPrecondition(there.status())) {
      return reported;
    }
    if (!there.ok()) return reported.ok() ? there.status() : reported;
    if (*there) return absl::OkStatus();
    if (!reported.ok()) return reported;
    return absl::UnavailableError(
        absl::StrCat("the PACS '", peer_.name, "' says that it has the object ",
                     header.instance_uid, " and does not find it: tried again"));
  }

  absl::Status HttpFailed(const HttpAnswer& answer, absl::string_view what) const {
    const std::string message = absl::StrCat("the PACS '", peer_.name, "' answers ", what,
                                             " with HTTP status ", answer.status);
    switch (answer.status) {
      case 401:
      case 403:
        return absl::PermissionDeniedError(message + ": let our certificate in there");
      case 404:
        return absl::NotFoundError(message);
      case 405:
      case 501:
        return absl::UnimplementedError(message + ": allow it there");
      case 429:
      case 500:
      case 502:
      case 503:
      case 504:
        return absl::UnavailableError(message + ": try again");
      default:
        return absl::FailedPreconditionError(message + ": see its log, and its URL here");
    }
  }

  absl::Status Missing(absl::string_view what) const {
    return absl::NotFoundError(absl::StrCat("the PACS '", peer_.name, "' has no such ", what));
  }

  const PacsPeer peer_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<PacsClient>> MakeDicomWebClient(const PacsPeer& peer) {
  PacsPeer checked = peer;
  checked.url = std::string(absl::StripSuffix(peer.url, "/"));
  TF_RETURN_IF_ERROR(CheckPacsUrl(checked));
  if (peer.tls) {
    TF_RETURN_IF_ERROR(ReadTlsFiles(*peer.tls).status());
  }
  return std::make_unique<DicomWebClient>(std::move(checked));
}

}  // namespace tissueform
