// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/store_request.h"

#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/ascii.h"
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmnet/dimse.h>

#include "client/pacs_bridge/dicom/dicom_uid.h"
#include "client/pacs_bridge/network/instance_stream.h"

namespace tissueform {
namespace {

constexpr Uint16 kDuplicate = 0x0111;
constexpr Uint16 kProcessingFailure = 0x0110;

std::string Trimmed(const char* text) { return std::string(absl::StripAsciiWhitespace(text)); }

Uint16 StoreStatus(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kOk:
      return STATUS_STORE_Success;
    case absl::StatusCode::kResourceExhausted:
      return STATUS_STORE_Refused_OutOfResources;
    case absl::StatusCode::kAlreadyExists:
      return kDuplicate;
    case absl::StatusCode::kInvalidArgument:
      return STATUS_STORE_Error_CannotUnderstand;
    case absl::StatusCode::kUnimplemented:
      return STATUS_STORE_Refused_SOPClassNotSupported;
    default:
      return kProcessingFailure;
  }
}

// Why nothing of this object is kept, before a byte of it has come.
absl::Status CheckRequest(const AnnouncedInstance& announced, absl::string_view abstract_syntax,
                          const InstanceFolder& folder) {
  if (!IsDicomUid(announced.instance_uid)) {
    return absl::InvalidArgumentError("an object's UID is invalid");
  }
  if (announced.class_uid != abstract_syntax) {
    return absl::UnimplementedError("an object has another class than its presentation context");
  }
  return folder.CheckRoom();
}

}  // namespace

absl::Status ReceiveStore(T_ASC_Association* association, int presentation_context,
                          const T_DIMSE_C_StoreRQ& request, AnnouncedInstance announced,
                          int idle_seconds, const InstanceFolder& folder, InstanceSink* sink,
                          absl::Status* status) {
  auto presentation = static_cast<T_ASC_PresentationContextID>(presentation_context);
  T_ASC_PresentationContext context;
  if (ASC_findAcceptedPresentationContext(association->params, presentation, &context).bad() ||
      request.DataSetType == DIMSE_DATASET_NULL) {
    return absl::InvalidArgumentError("a request without a data set or presentation context");
  }
  announced.class_uid = Trimmed(request.AffectedSOPClassUID);
  announced.instance_uid = Trimmed(request.AffectedSOPInstanceUID);
  announced.transfer_syntax_uid = Trimmed(context.acceptedTransferSyntax);
  *status = CheckRequest(announced, Trimmed(context.abstractSyntax), folder);
  std::optional<PartialFile> partial;
  if (status->ok()) {
    absl::StatusOr<PartialFile> created = folder.NewPartial();
    *status = created.status();
    if (created.ok()) partial.emplace(*std::move(created));
  }
  const std::unique_ptr<InstanceStream> stream =
      partial ? std::make_unique<InstanceStream>(partial->path(), announced,
                                                 folder.options().limits.max_file_bytes)
              : std::make_unique<InstanceStream>(*status);
  const OFCondition received = DIMSE_receiveDataSetInFile(
      association, DIMSE_NONBLOCKING, idle_seconds, &presentation, stream.get(), nullptr, nullptr);
  if (received.bad()) {
    return absl::UnavailableError("it was interrupted within an object");
  }
  *status = stream->Close();
  if (status->ok()) *status = folder.Take(*std::move(partial), announced, sink).status();
  T_DIMSE_C_StoreRSP response = {};
  response.DimseStatus = StoreStatus(*status);
  if (DIMSE_sendStoreResponse(association, presentation, &request, &response, nullptr).bad()) {
    return absl::UnavailableError("it was interrupted before an answer");
  }
  return absl::OkStatus();
}

}  // namespace tissueform
