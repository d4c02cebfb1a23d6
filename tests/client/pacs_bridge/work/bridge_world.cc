// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/client/pacs_bridge/work/bridge_world.h"

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>

namespace tissueform::testing {

absl::StatusOr<std::vector<ExportFile>> HeaderWriter::Write(const ExportMaterial& material) {
  std::vector<ExportFile> files;
  for (const char* key : {"stl:skin", "stl:bone", "capture", "report"}) {
    TF_ASSIGN_OR_RETURN(const auto source, LoadDicomHeader(material.header));
    source->getDataset()->putAndInsertString(DCM_SOPInstanceUID, material.uids.at(key).c_str());
    if (more_bytes > 0) {
      const std::vector<Uint8> more(more_bytes);
      source->getDataset()->putAndInsertUint8Array(DCM_EncapsulatedDocument, more.data(),
                                                   static_cast<unsigned long>(more.size()));
    }
    const std::string path = absl::StrCat(material.folder, "/", material.uids.at(key), ".dcm");
    TF_RETURN_IF_ERROR(SaveDicomFile(path, source->getDataset()));
    files.push_back({key, path});
  }
  return files;
}

}  // namespace tissueform::testing
