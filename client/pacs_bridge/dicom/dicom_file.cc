// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/dicom/dicom_file.h"

#include <cerrno>
#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <unistd.h>

#include "absl/strings/str_cat.h"
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcostrma.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmdata/dcwcache.h>

#include "client/pacs_bridge/dicom/dicom_uid.h"
#include "client/pacs_bridge/dicom/partial_file.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr Uint32 kReadAtOnceBytes = 64 << 10;

absl::Status Refused(const std::string& path, absl::string_view why) {
  return absl::InvalidArgumentError(absl::StrCat(path, ": ", why));
}

// In both orders of bytes: an item's tag. Those that chance puts among pixels do no harm.
int64_t CountItems(absl::string_view bytes) {
  int64_t count = 0;
  for (const absl::string_view mark : {"\xFE\xFF\x00\xE0", "\xFF\xFE\xE0\x00"}) {
    const absl::string_view four(mark.data(), 4);
    for (size_t at = bytes.find(four); at != absl::string_view::npos; at = bytes.find(four, at + 4))
      ++count;
  }
  return count;
}

// Reads piece by piece: the file may be large and is not kept.
absl::Status CheckBytes(const std::string& path, const DicomLimits& limits) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) {
    return absl::NotFoundError(absl::StrCat(path, ": there is no such file"));
  }
  if (!std::filesystem::is_regular_file(status)) return Refused(path, "it is not a file");
  const auto size = static_cast<int64_t>(std::filesystem::file_size(path, error));
  if (error || size > limits.max_file_bytes) {
    return Refused(path, absl::StrCat("it has ", size, " bytes, more than the limit of ",
                                      limits.max_file_bytes));
  }
  std::ifstream file(path, std::ios::binary);
  constexpr size_t kOverlap = 3;
  std::string piece(kOverlap, '\0');
  int64_t items = 0;
  while (file) {
    piece.erase(0, piece.size() - kOverlap);
    const size_t kept = piece.size();
    piece.resize(kept + (1 << 20));
    file.read(piece.data() + kept, 1 << 20);
    piece.resize(kept + static_cast<size_t>(file.gcount()));
    items += CountItems(piece);
    if (items > limits.max_items) {
      return Refused(path, absl::StrCat("it has more than ", limits.max_items,
                                        " items; only single images are supported"));
    }
  }
  return absl::OkStatus();
}

// Curves and overlays, in groups that repeat: what is drawn over pixels.
bool IsDrawn(Uint16 group) { return (group & 0xFF00) == 0x5000 || (group & 0xFF00) == 0x6000; }

void RemovePrivateAndDrawn(DcmItem* item) {
  for (unsigned long i = item->card(); i > 0; --i) {
    const Uint16 group = item->getElement(i - 1)->getGTag();
    if (group % 2 == 1 || IsDrawn(group)) delete item->remove(i - 1);
  }
}

// Keeps the errors of writing to the disk. DCMTK's own stream does not report a full disk: it
// writes a small file only when it closes it, and ignores the result.
class FileConsumer final : public DcmConsumer {
 public:
  explicit FileConsumer(const std::string& path)
      : path_(path), descriptor_(open(path.c_str(), O_WRONLY | O_CLOEXEC)) {
    if (descriptor_ < 0) failure_ = ErrorOfFile(errno, path_);
  }
  ~FileConsumer() override { Close().IgnoreError(); }
  FileConsumer(const FileConsumer&) = delete;
  FileConsumer& operator=(const FileConsumer&) = delete;

  OFBool good() const override { return OFTrue; }
  OFCondition status() const override { return EC_Normal; }
  OFBool isFlushed() const override { return OFTrue; }
  offile_off_t avail() const override { return kMaxAtOnceBytes; }
  void flush() override {}
  offile_off_t write(const void* bytes, offile_off_t count) override {
    const auto* next = static_cast<const char*>(bytes);
    for (auto left = static_cast<size_t>(count); failure_.ok() && left > 0;) {
      const ssize_t done = ::write(descriptor_, next, left);
      if (done < 0 && errno == EINTR) continue;
      if (done < 0) {
        failure_ = ErrorOfFile(errno, path_);
      } else {
        next += done;
        left -= static_cast<size_t>(done);
      }
    }
    return count;
  }

  // What went wrong so far.
  absl::Status Close() {
    if (descriptor_ >= 0 && close(descriptor_) != 0 && failure_.ok()) {
      failure_ = ErrorOfFile(errno, path_);
    }
    descriptor_ = -1;
    return failure_;
  }

 private:
  static constexpr offile_off_t kMaxAtOnceBytes = 1 << 30;

  const std::string path_;
  int descriptor_;
  absl::Status failure_;
};

class FileOutput final : public DcmOutputStream {
 public:
  explicit FileOutput(FileConsumer* consumer) : DcmOutputStream(consumer) {}
};

}  // namespace

absl::Status PrepareDcmtk() {
  static const bool found = [] {
    OFLog::configure(OFLogger::OFF_LOG_LEVEL);
    return bool{dcmDataDict.isDictionaryLoaded() == OFTrue};
  }();
  if (found) return absl::OkStatus();
  return absl::FailedPreconditionError(
      "DCMTK's data dictionary is missing: install libdcmtk17, or set DCMDICTPATH to dicom.dic");
}

absl::StatusOr<std::unique_ptr<DcmFileFormat>> LoadDicomHeader(const std::string& path,
                                                               const DicomLimits& limits) {
  TF_RETURN_IF_ERROR(PrepareDcmtk());
  TF_RETURN_IF_ERROR(CheckBytes(path, limits));
  auto file = std::make_unique<DcmFileFormat>();
  const OFFilename name(path.c_str());
  // The meta header first: what is deflated would be unpacked before any limit is seen.
  DcmMetaInfo meta;
  OFString syntax;
  if (meta.loadFile(name).bad() || meta.findAndGetOFString(DCM_TransferSyntaxUID, syntax).bad()) {
    return Refused(path, "it is not a DICOM file with a meta header");
  }
  if (absl::string_view(syntax.c_str()) == kDeflatedLittleEndian) {
    return Refused(path, "it is deflated, which is not supported; store it uncompressed");
  }
  const OFCondition read = file->loadFileUntilTag(name, EXS_Unknown, EGL_noChange, kReadAtOnceBytes,
                                                  ERM_fileOnly, DCM_PixelData);
  if (read.bad()) return Refused(path, "it is damaged, truncated, or not a DICOM file");
  return file;
}

absl::Status SaveDicomFile(const std::string& path, DcmDataset* dataset) {
  TF_RETURN_IF_ERROR(PrepareDcmtk());
  TF_ASSIGN_OR_RETURN(PartialFile partial, PartialFile::Create(absl::StrCat(path, ".partial")));
  DcmFileFormat file(dataset, OFFalse);
  FileConsumer consumer(partial.path());
  OFCondition written;
  {
    FileOutput output(&consumer);
    DcmWriteCache cache;
    file.transferInit();
    written =
        file.write(output, EXS_LittleEndianExplicit, EET_ExplicitLength, &cache, EGL_recalcGL);
    file.transferEnd();
  }
  file.getAndRemoveDataset();  // the caller's
  TF_RETURN_IF_ERROR(consumer.Close());
  if (written.bad()) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": cannot be written as DICOM: ", written.text()));
  }
  return partial.Publish(path);
}

absl::Status CopyHeaderOnly(const std::string& from, const std::string& to,
                            const DicomLimits& limits) {
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<DcmFileFormat> file, LoadDicomHeader(from, limits));
  DcmDataset* dataset = file->getDataset();
  RemovePrivateAndDrawn(dataset);
  delete dataset->remove(DCM_IconImageSequence);  // pixels too
  return SaveDicomFile(to, dataset);
}

}  // namespace tissueform
