// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/instance_stream.h"

#include <cerrno>
#include <fcntl.h>
#include <unistd.h>
#include <utility>

#include "absl/strings/str_cat.h"
#include <dcmtk/dcmdata/dctk.h>

namespace tissueform {
namespace {

// "Tissueform" in the meta header of every file; a UID made once.
constexpr char kImplementationClass[] = "2.25.214283916427316283742189640313270164903";
constexpr char kImplementationVersion[] = "TISSUEFORM";

OFCondition WriteMetaHeader(const AnnouncedInstance& announced, DcmOutputStream* stream) {
  DcmMetaInfo meta;
  meta.insert(new DcmUnsignedLong(DCM_FileMetaInformationGroupLength), OFTrue);
  const Uint8 version[] = {0, 1};
  meta.putAndInsertUint8Array(DCM_FileMetaInformationVersion, version, 2);
  meta.putAndInsertString(DCM_MediaStorageSOPClassUID, announced.class_uid.c_str());
  meta.putAndInsertString(DCM_MediaStorageSOPInstanceUID, announced.instance_uid.c_str());
  meta.putAndInsertString(DCM_TransferSyntaxUID, announced.transfer_syntax_uid.c_str());
  meta.putAndInsertString(DCM_ImplementationClassUID, kImplementationClass);
  meta.putAndInsertString(DCM_ImplementationVersionName, kImplementationVersion);
  meta.putAndInsertString(DCM_SourceApplicationEntityTitle, announced.calling_ae.c_str());
  meta.computeGroupLengthAndPadding(EGL_withGL, EPD_noChange, EXS_LittleEndianExplicit,
                                    EET_UndefinedLength);
  meta.transferInit();
  const OFCondition written =
      meta.write(*stream, EXS_LittleEndianExplicit, EET_ExplicitLength, nullptr);
  meta.transferEnd();
  return written;
}

}  // namespace

class InstanceStream::File : public DcmConsumer {
 public:
  File(const std::string& path, int64_t max_bytes)
      : max_bytes_(max_bytes), descriptor_(open(path.c_str(), O_WRONLY | O_CLOEXEC)) {
    if (descriptor_ < 0) failure_ = absl::ErrnoToStatus(errno, path);
  }
  explicit File(absl::Status failure)
      : max_bytes_(0), descriptor_(-1), failure_(std::move(failure)) {}
  ~File() override {
    if (descriptor_ >= 0) close(descriptor_);
  }

  OFBool good() const override { return OFTrue; }
  OFCondition status() const override { return EC_Normal; }
  OFBool isFlushed() const override { return OFTrue; }
  offile_off_t avail() const override { return 1 << 30; }
  void flush() override {}
  offile_off_t write(const void* bytes, offile_off_t count) override {
    if (failure_.ok()) Append(static_cast<const char*>(bytes), static_cast<size_t>(count));
    return count;
  }

  void Fail(absl::Status failure) {
    if (failure_.ok()) failure_ = std::move(failure);
  }

  absl::Status Close() {
    if (descriptor_ >= 0 && close(descriptor_) != 0) Fail(absl::ErrnoToStatus(errno, "closing"));
    descriptor_ = -1;
    return failure_;
  }

 private:
  void Append(const char* bytes, size_t count) {
    written_ += static_cast<int64_t>(count);
    if (written_ > max_bytes_) {
      // No want of room, after which its sender would try again and again.
      return Fail(absl::InvalidArgumentError(
          absl::StrCat("an object has more than ", max_bytes_, " bytes")));
    }
    while (count > 0) {
      const ssize_t done = ::write(descriptor_, bytes, count);
      if (done < 0 && errno == EINTR) continue;
      if (done <= 0) return Fail(absl::ErrnoToStatus(errno, "writing an object"));
      bytes += done;
      count -= static_cast<size_t>(done);
    }
  }

  const int64_t max_bytes_;
  int descriptor_;
  int64_t written_ = 0;
  absl::Status failure_;
};

InstanceStream::InstanceStream(std::unique_ptr<File> file)
    : DcmOutputStream(file.get()), file_(std::move(file)) {}

InstanceStream::InstanceStream(const std::string& partial, const AnnouncedInstance& announced,
                               int64_t max_bytes)
    : InstanceStream(std::make_unique<File>(partial, max_bytes)) {
  if (WriteMetaHeader(announced, this).bad()) {
    file_->Fail(absl::InternalError("the meta header cannot be written"));
  }
}

InstanceStream::InstanceStream(absl::Status failure)
    : InstanceStream(std::make_unique<File>(std::move(failure))) {}

InstanceStream::~InstanceStream() = default;

absl::Status InstanceStream::Close() { return file_->Close(); }

}  // namespace tissueform
