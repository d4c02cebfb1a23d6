// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/objects/capture_object.h"

#include <cstdint>
#include <filesystem>
#include <memory>
#include <png.h>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>

#include "client/pacs_bridge/objects/dicom_items.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

struct PngFree {
  void operator()(png_image* image) const { png_image_free(image); }
};

// The end of `frames` grows by the picture.
absl::Status AppendPicture(const std::string& path, CaptureFrames* frames) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) {
    return absl::NotFoundError(absl::StrCat(path, ": there is no such picture"));
  }
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  const std::unique_ptr<png_image, PngFree> freed(&image);
  if (png_image_begin_read_from_file(&image, path.c_str()) == 0) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": it is not a readable PNG"));
  }
  if (image.width > kMaxPicturePixels || image.height > kMaxPicturePixels) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": it has more than ", kMaxPicturePixels,
                                                   " pixels in a row or a column"));
  }
  if (frames->rgb.empty()) {
    frames->width = image.width;
    frames->height = image.height;
  }
  if (image.width != frames->width || image.height != frames->height) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": its size differs from the pictures before it"));
  }
  image.format = PNG_FORMAT_RGB;
  const size_t before = frames->rgb.size();
  frames->rgb.resize(before + PNG_IMAGE_SIZE(image));
  const png_color white = {255, 255, 255};
  if (png_image_finish_read(&image, &white, frames->rgb.data() + before, 0, nullptr) == 0) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": it is damaged or truncated"));
  }
  return absl::OkStatus();
}

void WritePixels(CaptureFrames frames, size_t count, ItemWriter* writer) {
  writer->Number(DCM_SamplesPerPixel, 3);
  writer->Text(DCM_PhotometricInterpretation, "RGB");
  writer->Number(DCM_PlanarConfiguration, 0);
  writer->Text(DCM_NumberOfFrames, absl::StrCat(count));
  writer->Number(DCM_Rows, static_cast<uint16_t>(frames.height));
  writer->Number(DCM_Columns, static_cast<uint16_t>(frames.width));
  writer->Number(DCM_BitsAllocated, 8);
  writer->Number(DCM_BitsStored, 8);
  writer->Number(DCM_HighBit, 7);
  writer->Number(DCM_PixelRepresentation, 0);
  if (frames.rgb.size() % 2 == 1) frames.rgb.push_back(0);
  writer->Bytes(DCM_PixelData, frames.rgb);
}

// The frames are pages: no time lies between them.
absl::Status WritePages(size_t count, DcmDataset* object) {
  std::vector<std::string> pages;
  for (size_t page = 1; page <= count; ++page) pages.push_back(absl::StrCat(page));
  ItemWriter writer(object);
  writer.Text(DCM_PageNumberVector, absl::StrJoin(pages, "\\"));
  TF_RETURN_IF_ERROR(writer.status());
  if (object->putAndInsertTagKey(DCM_FrameIncrementPointer, DCM_PageNumberVector).good()) {
    return absl::OkStatus();
  }
  return absl::InternalError("the attribute (0028,0009) cannot be written");
}

}  // namespace

absl::StatusOr<CaptureFrames> ReadCaptureFrames(const std::vector<std::string>& paths) {
  CaptureFrames frames;
  for (const std::string& path : paths) TF_RETURN_IF_ERROR(AppendPicture(path, &frames));
  return frames;
}

absl::Status WriteCaptureModules(const PredictionObjectsInput& input, DcmDataset* object) {
  TF_ASSIGN_OR_RETURN(CaptureFrames frames, ReadCaptureFrames(input.pictures));
  ItemWriter writer(object);
  writer.Text(DCM_ImageType, "DERIVED\\SECONDARY");
  writer.Text(DCM_ConversionType, "WSD");
  writer.Text(DCM_Laterality, "");
  writer.Text(DCM_PatientOrientation, "");
  writer.Text(DCM_BurnedInAnnotation, "NO");
  writer.Text(DCM_RecognizableVisualFeatures, "YES");
  writer.Text(DCM_LossyImageCompression, "00");
  writer.Text(DCM_DerivationDescription, "Pictures of a prediction of soft tissue");
  writer.Text(DCM_ImageComments,
              absl::StrCat("Face before and after, movement in mm, bone. ", kResearchNotice));
  WritePixels(std::move(frames), input.pictures.size(), &writer);
  TF_RETURN_IF_ERROR(writer.status());
  TF_RETURN_IF_ERROR(WritePages(input.pictures.size(), object));
  return WriteSourceImages(input, object);
}

}  // namespace tissueform
